"""Checks on the channels of servers and their life (spec 1.0 chapter 3)."""

import itertools
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.text import broken_texts
from splatbus_conformance.checks import SERVER, SERVER_IPC, SERVER_MSG, Cases, End, Needs, check
from splatbus_conformance.trials.controls import CAMERA_REQUEST, VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.bad_neighbours import (
    BAD_NEIGHBOURS,
    BAD_READERS,
    CROWD,
    HARMLESS,
    BadNeighbour,
    crowd,
)
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.exchanges.answered import every_request
from splatbus_conformance.trials.moves.stalled import PATIENCE_SECONDS, stalled
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import GONE_SECONDS
from splatbus_conformance.trials.trial import ENDING_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_conformance.wire.messages import encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

BURST = 200
AGAIN = 2
STALLS = 4
"""Tries to stall a server, and to read on in time: a busy machine keeps the harness from it."""
SPARE = 12
FURTHER = 100
"""More connections than most servers keep on a channel, or systems in their place."""
EITHER: dict[End, Needs] = {SERVER_MSG: (), SERVER_IPC: ()}
READERS = 12
"""As many of them want images."""
UNKNOWN = {"type": "weather_report", "sunny": True}
NOBODYS: tuple[tuple[object, bytes], ...] = (
    ("unknown", encode(UNKNOWN)),
    ("release", encode({"type": "release", "generation": 1, "seq": 1})),
    ("subscribe", encode({"type": "subscribe", "channels": ["color"]})),
    ("request", encode(VIEWPORT_REQUEST)),
    ("no type", encode({"hello": "there"})),
    ("longest", b" " * LIMITS["max_payload_bytes"]),
    *((text.kind, text.payload) for text in broken_texts(UNKNOWN)),
)
"""Payloads on the IPC channel of 1.0, where no client says anything, by their kind."""
HELLO = ("hello", encode(hello([*CAPABILITIES["ipc"]], None)))
"""One more, to who speaks 1.0 alone."""


@check("CHN-1", on={SERVER: ()})
def check_offers_both_channels(trial: ServerTrial) -> None:
    """A connection to each channel, the one beside the other."""
    for channel in CHANNELS:
        trial.expect(
            trial.facts.listens[channel],
            "not-listening",
            f"nothing listens on port {trial.peer.ports[channel]}, the {channel} channel",
        )
    ipc, msg = trial.dial("ipc"), trial.dial("msg")
    trial.expect(trial.answers(msg), "no-reply", "no reply on the message channel")
    trial.expect(not ipc.ended, "closes", "the IPC connection was ended")


@check("CHN-4", on={SERVER: ("cuda",)})
def check_everyone_is_sent_an_init_packet(trial: ServerTrial) -> None:
    """Client after client, on the IPC channel, which say nothing."""
    for number in range(1, 6):
        connection = trial.dial("ipc")
        _hears(trial, connection)
        trial.expect(
            trial.with_(connection).init_packets,
            "no-init-packet",
            f"the IPC client number {number} got no init packet",
        )
        connection.close()


@check("CHN-7", on={SERVER: ()}, may_crash=True)
def check_bytes_do_not_end_an_ipc_connection(trial: ServerTrial) -> None:
    """Messages that no client of 1.0 sends there, broken text, and the longest packet."""
    connection = trial.dial("ipc")
    said = NOBODYS if trial.facts.version() != "1.0" else (HELLO, *NOBODYS)
    for _, payload in trial.each(said, kind=lambda it: it[0], spare=SPARE):
        connection.send(packet(payload))
        closed = trial.ends(connection, REACTION_SECONDS / 40)
        outcome = trial.fate() or ("closes" if closed else "ignores")
        trial.judge(outcome, f"{payload[:60]!r} on the IPC channel")
    closed = trial.ends(connection, REACTION_SECONDS)
    trial.judge(trial.fate() or ("closes" if closed else "ignores"), "all these on the IPC channel")
    connection.close()
    if not trial.serves():
        trial.not_observable("the connection stayed open, and the server serves nobody")


@check("CHN-7", on={SERVER: ()}, profile="full")
def check_bytes_do_not_end_an_ipc_connection_later(trial: ServerTrial) -> None:
    """A whole packet, and then silence, for longer than a packet may take to be complete."""
    silent, spoken = trial.dial("ipc"), trial.dial("ipc")
    spoken.send(packet(NOBODYS[0][1]))
    trial.ends(spoken, LIMITS["packet_completion_seconds"] + 5 * REACTION_SECONDS)
    if trial.ends(silent, REACTION_SECONDS):
        trial.not_observable("the server ends an IPC connection on which nothing is said, too")
    outcome = trial.fate() or ("closes" if spoken.ended else "ignores")
    trial.judge(outcome, f"{NOBODYS[0][1][:60]!r} on the IPC channel, and then nothing")
    trial.peer.close_all()
    if not trial.serves():
        trial.not_observable("the connection stayed open, and the server serves nobody")


@check("CHN-12", on=EITHER)
def check_serves_both_channels_at_a_time(trial: ServerTrial, first: Channel) -> None:
    """Either channel first; then requests, and frames where there are any."""
    trial.peer.close_all()
    (second,) = {*CHANNELS} - {first}
    open_on = {"msg": trial.dial, "ipc": trial.before_hello}
    connections = {channel: open_on[channel](channel) for channel in (first, second)}
    ipc, msg = connections["ipc"], connections["msg"]
    what = f"beside a client on the {second} channel that came after one on the {first} channel"
    trial.expect(trial.answers(msg), "no-reply", f"no reply {what}")
    if trial.facts.welcome["ipc"] is not None:
        trial.viewer.greet(ipc)
        trial.expect(trial.is_welcomed(ipc), "no-welcome", f"no welcome on the IPC channel {what}")
        if trial.facts.init_packet is not None:
            trial.wait(lambda: trial.with_(ipc).init_packets or ipc.ended)
        trial.expect(trial.answers(msg), "no-reply", f"no further reply {what}")
    for channel, connection in connections.items():
        trial.expect(not connection.ended, "closes", f"the {channel} connection was ended {what}")


@check("CHN-13", on={SERVER: ()})
def check_further_connections_are_not_left_waiting(trial: ServerTrial) -> bool:
    """A hundred clients on the message channel, which ask at once, and none of which goes."""
    numbers = list(trial.each(range(1, FURTHER + 1)))
    came: list[Connection | None] = []
    while len(came) < len(numbers) and None not in came:
        came.append(trial.served("msg"))
        if came[-1] is not None:
            trial.viewer.say(came[-1], VIEWPORT_REQUEST)

    def is_served(client: Connection) -> bool:
        return trial.wait(lambda: trial.replies(client) or client.ended)

    for number, client in enumerate(came, 1):
        served = client is not None and is_served(client)
        if trial.fate() or not served:
            trial.judge(trial.fate() or "waits", f"client number {number} on the message channel")
    count = sum(bool(client and trial.replies(client)) for client in came)
    trial.extent = f"of {len(came)} connections {count} were served"
    return count > 0


@check("CHN-13", on={SERVER: ("1.1",)})
def check_further_ipc_connections_are_not_left_waiting(trial: ServerTrial) -> None:
    """A hundred clients on the IPC channel, which say hello, and none of which goes."""
    trial.greeted("ipc")
    for number in trial.each(range(2, FURTHER + 1)):
        connection = trial.before_hello("ipc")
        trial.viewer.greet(connection, **({} if number <= READERS else {"capabilities": []}))
        if not _hears(trial, connection) or trial.fate():
            trial.judge(trial.fate() or "waits", f"client number {number} on the IPC channel")


def _hears(trial: ServerTrial, connection: Connection) -> bool:
    """Whether something is said on this connection in time, or it is ended."""
    return trial.wait(lambda: trial.with_(connection).heard or connection.ended)


TRIES = 3


def _crowded(trial: ServerTrial) -> tuple[Connection, list[Connection]]:
    """A client that was answered, and others that say nothing, until one of all of them is ended,
    or there is a crowd.

    Each is given time to be taken in before the next comes: a server that takes in several at once
    may end one for each, and one that has not begun to has ended none.
    """
    asking, silent = trial.served("msg"), list[Connection]()
    if asking is None or not trial.answers(asking):
        trial.not_observable("no request is answered")
    while not (asking.ended or any(it.ended for it in silent)) and len(silent) < CROWD:
        silent.append(trial.before_hello("msg"))
        trial.rest(REACTION_SECONDS)
        trial.ask(asking, VIEWPORT_REQUEST)
    return asking, silent


@check("CHN-25", on={SERVER: ()})
def check_keeps_who_has_spoken(trial: ServerTrial) -> None:
    """One client has been answered; others come that say nothing, and none of which goes."""
    for _ in range(TRIES):
        asking, silent = _crowded(trial)
        kept = [it for it in silent[:-1] if not it.ended]
        trial.expect(
            not (asking.ended and kept),
            "ends-a-speaker",
            f"a client that was answered is ended in favour of the last of {len(silent)} that have"
            f" said nothing, {len(kept)} of which stay",
        )
        if not asking.ended:
            break  # else places were held by connections of which the server knew no end yet
        trial.peer.close_all()
        trial.rest(REACTION_SECONDS)


def commit(trial: ServerTrial, channel: Channel, neighbour: BadNeighbour) -> Connection:
    """Let somebody new do this; on which connection."""
    culprit = neighbour.begins(trial, channel)
    neighbour.commit(trial, culprit)
    return culprit


class Bystanders:
    """Who does nothing wrong: one that asks, and one that reads images where there are some."""

    def __init__(self, trial: ServerTrial, channel: Channel) -> None:
        self.can_stay = not (channel == "msg" and trial.facts.alone["msg"])
        """Somebody else may be on that channel, and is not ended for it."""
        self._trial, self._channel = trial, channel
        self._witness: Connection | None = None
        self._steering: CameraControl | None = None

    def stay(self, neighbour: BadNeighbour, what: str) -> bool:
        """Let somebody do this beside them: whether they stay. Violated if they do, unserved."""
        trial = self._trial
        steering = self._reading()
        witness = self._asking(steering)
        culprit = commit(trial, self._channel, neighbour)
        answered = trial.answers(witness)
        trial.expect(not trial.fate(), "unserved", f"no reply beside {what}")
        trial.expect(answered or witness.ended, "unserved", f"no reply beside {what}")
        if answered and steering is not None:
            seen = steering.renders_for(witness)
            ended = witness.ended or steering.reader.ended
            trial.expect(seen or ended, "unserved", f"no new image beside {what}")
            answered = seen
        culprit.close()
        return answered

    def _asking(self, steering: CameraControl | None) -> Connection:
        if self._witness is None or self._witness.gone:
            if self._witness is not None:
                self._witness.close()
            self._trial.rest(GONE_SECONDS)
            self._witness = self._trial.dial("msg")
            answered = self._trial.answers(self._witness)
            self._trial.expect(answered, "no-reply", "no reply on the message channel")
            if steering is not None:  # it is to have control, whoever poses after it
                seen = steering.renders_for(self._witness) or steering.reader.ended
                self._trial.expect(seen, "no-image", "no new image after a pose")
        return self._witness

    def _reading(self) -> CameraControl | None:
        facts = self._trial.facts
        if not facts.renders or (self._channel == "ipc" and facts.alone["ipc"]):
            return None
        if self._steering is None or self._steering.reader.gone:
            if self._steering is not None:
                self._steering.reader.close()
            self._steering = CameraControl(self._trial)
        return self._steering


@contextmanager
def bystanders(trial: ServerTrial, channel: Channel) -> Iterator[Bystanders]:
    """They are there from now on; afterwards everybody has gone, and the next client is served."""
    yield Bystanders(trial, channel)
    trial.peer.close_all()
    trial.expect(
        trial.serves(),
        "not-served",
        f"no reply to the next client, after all on the {channel} channel",
    )


def _neighbours(trial: ServerTrial, channel: Channel, _: object) -> Cases:
    reads = channel == "ipc" and trial.facts.renders
    return Cases((*BAD_NEIGHBOURS, *(BAD_READERS if reads else ())))


@check("CHN-14", on=EITHER, given=bystanders, cases=_neighbours, may_crash=True)
def check_others_are_served_whatever_one_does(
    trial: ServerTrial, channel: Channel, others: Bystanders, neighbour: BadNeighbour
) -> None:
    """One client sends what it should not, or too little, does not read, resets or vanishes, or,
    where it reads images, holds a lease, or resets while it does. Others are answered, and see new
    images; whoever comes next is served.

    A server may end one client on a channel in favour of another (CHN-13). So one that is ended
    tells something only if the same one stays beside a client that does nothing wrong.
    """
    what = f"a client that {neighbour.what}, on the {channel} channel"
    if others.can_stay and not others.stay(neighbour, what):
        others.can_stay = others.stay(HARMLESS[channel], f"a client on the {channel} channel")
        if others.can_stay:
            stayed = any(others.stay(neighbour, what) for _ in range(AGAIN))
            trial.expect(stayed, "closes", f"the connection of another is ended beside {what}")
    if not others.can_stay:
        trial.peer.close_all()
        commit(trial, channel, neighbour).close()
    if trial.facts.alone["msg"]:
        trial.peer.close_all()
    if not trial.serves():
        trial.wait(trial.fate, ENDING_SECONDS)
        trial.violated("not-served", f"no reply after {what}")


@check("CHN-14", on=EITHER, may_crash=True)
def check_a_crowd_does_no_harm(trial: ServerTrial, channel: Channel) -> None:
    """Eight clients on a channel that say nothing, and forty that come and go at once."""
    witness = trial.dial("msg")
    trial.expect(trial.answers(witness), "no-reply", "no reply on the message channel")
    crowd(trial, channel)
    trial.expect(
        trial.answers(witness) or witness.ended,
        "no-reply",
        f"no reply beside {CROWD} idle clients on the {channel} channel",
    )
    trial.peer.close_all()
    trial.expect(
        trial.serves(),
        "not-served",
        f"no reply after {CROWD} idle clients on the {channel} channel",
    )


@check(
    "CHN-16",
    on={SERVER: ()},
    cases=lambda trial: Cases(
        [
            (agreed, earlier, count)
            for agreed, earlier in ((False, False), (True, False), (False, True))
            if trial.facts.welcome["msg"] or not agreed
            for count in (0, 1, 3, BURST)
        ]
    ),
)
def check_answers_before_the_end(trial: ServerTrial, case: tuple[bool, bool, int]) -> None:
    """Requests of every kind in one write, and then the client's end of stream: none, one, three,
    and two hundred; the same where one was answered before, and after `hello`.
    """
    agreed, earlier, count = case
    connection = trial.greeted("msg") if agreed else trial.dial("msg")
    if earlier:
        trial.expect(trial.answers(connection), "no-reply", "no reply on the message channel")
    before = len(trial.with_(connection).heard)
    asked = itertools.islice(itertools.cycle(every_request(trial, connection)), count)
    connection.send(b"".join(packet(encode(each)) for each in asked))
    what = f"{count} requests and the end of the stream"
    what += " after hello" * agreed + " after one that was answered" * earlier
    _expect_answers(trial, connection, before, count, what)


@check("CHN-16", on={SERVER: ()})
def check_answers_all_that_waits_before_the_end(trial: ServerTrial) -> None:
    """Requests of which no reply is read, until some wait in the server; then the client's end of
    stream, inside a request where TCP takes no more, and it reads.
    """
    for _ in range(STALLS):
        stands = stalled(trial, CAMERA_REQUEST)
        trial.extent = stands.extent
        what = f"{stands.asked} requests, of which no reply was read, and the end of the stream"
        heard = len(trial.with_(stands.connection).heard)
        until = stands.moved + PATIENCE_SECONDS
        if _expect_answers(trial, stands.connection, heard, stands.asked, what, until):
            return
    trial.not_observable("nothing was read for so long that the server may end it (LIM-2)")


def _expect_answers(
    trial: ServerTrial,
    connection: Connection,
    before: int,
    count: int,
    what: str,
    until: float = math.inf,
) -> bool:
    """End the stream, and read on; False if that began after this moment of the monotonic clock."""
    heard = trial.with_(connection).heard
    connection.end_stream()
    if count and trial.grows(connection, heard, before) and time.monotonic() > until:
        connection.close()
        return False
    while len(heard) - before <= count and trial.grows(connection, heard, len(heard)):
        pass
    closed, replies = trial.ends(connection), len(heard) - before
    trial.expect(replies == count, "another-count", f"{replies} replies to {what}")
    trial.expect(closed, "not-closed", f"the server kept the connection open after {what}")
    trial.expect(
        connection.ended == "eof", "reset", f"the server reset the connection after {what}"
    )
    connection.close()
    return True
