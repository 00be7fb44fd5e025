"""Checks on packets: FRM (spec 1.0 section 2.1)."""

import itertools
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.spelling import spell_in_utf_8
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_DEVICE,
    CLIENT_IPC,
    CLIENT_MSG,
    DECLARES_HOST_MEMORY,
    SERVER,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    Place,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.device_listener import DEVICE, DeviceListener, listening
from splatbus_conformance.trials.moves.exchanges.exchange import (
    STRANGER,
    asked_on,
    exchange,
    judge_if_seen,
    refusal,
    require_refusal,
)
from splatbus_conformance.trials.moves.resizing import other_sizes, resizing
from splatbus_conformance.trials.returning import PROBES
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import (
    EFFECT_SECONDS,
    ENDING_SECONDS,
    REACTION_SECONDS,
    SETTLE_SECONDS,
)
from splatbus_conformance.wire.messages import Json, camera_pose, encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

Trial = ClientTrial | ServerTrial
MOST: int = LIMITS["max_payload_bytes"]
LIMIT: float = LIMITS["packet_completion_seconds"]
REQUEST = packet(encode(VIEWPORT_REQUEST))

# Bad lengths


class BadHeader(NamedTuple):
    """A header that announces no payload that there may be, and what stands around it."""

    length: int
    later: bool = False
    """Once the testee has taken a packet on the connection, not first."""
    follows: str = "nothing"
    """Or `a good packet`, or as much as it `announces`."""
    behind: bool = False
    """It comes right behind a good packet."""

    def __str__(self) -> str:
        place = " on a connection that was in use" if self.later else ""
        place += " behind a good packet" if self.behind else ""
        return f"a header that announces {self.length:,} bytes{place}, and {self.follows} behind it"


EXTREME = (0, MOST + 1, 0xFFFF_FFFF)
SWAPPED = (28 << 24, 1 << 24)
"""Lengths that are good when their bytes are read from the other end."""
HTTP = int.from_bytes(b"GET ", "little")
OTHERS = (HTTP, 2**31 - 1, 2**31, 0xFFFF_FF00)
FIRST_HEADERS = (
    *(BadHeader(length) for length in (*EXTREME, *SWAPPED, *OTHERS)),
    *(BadHeader(length, follows="a good packet") for length in (*EXTREME, *SWAPPED)),
    BadHeader(MOST + 1, follows="as much as it announces"),
)
BAD_HEADERS = (*FIRST_HEADERS, *(it._replace(later=True) for it in FIRST_HEADERS[:9]))
TOO_LONG = encode(STRANGER).ljust(MOST + 1)
DRAWN_HEADERS = st.tuples(
    st.integers(MOST + 1, 0xFFFF_FFFF), st.booleans(), st.just("a good packet")
)


def kind_of(header: BadHeader) -> object:
    """What is too extreme, or too near to what is right, to stand for another."""
    if header.later or header.behind or header.follows == "as much as it announces":
        return header.follows, header.behind
    return header.length if header.length in EXTREME else header.length in SWAPPED


TO_SERVERS = Cases(BAD_HEADERS, DRAWN_HEADERS, kind_of, spare=4, quick=2, full=60)


@check(
    "FRM-3",
    on={CLIENT_IPC: ("ipc",), CLIENT_MSG: ("asks",), SERVER_IPC: (), SERVER_MSG: ()},
    cases={
        CLIENT_IPC: Cases(BAD_HEADERS, kind=kind_of),
        # In place of a reply, of which a client waits for no later one.
        CLIENT_MSG: Cases(FIRST_HEADERS[:9], kind=kind_of),
        SERVER_IPC: TO_SERVERS,
        SERVER_MSG: TO_SERVERS._replace(listed=(*BAD_HEADERS, BadHeader(0, behind=True))),
    },
    may_crash=True,
)
def check_bad_length_closes(trial: Trial, channel: Channel, case: BadHeader) -> bool:
    """A header that announces nothing, or more than the limit, in place of the first packet, or of
    a later one; alone, followed by a good packet, and by as many bytes as it announces.
    """
    bad = BadHeader(*case)
    it = exchange(trial, channel, bad.later)
    if it is None:
        return False
    good = b"".join(it.packets)
    follows = {"nothing": b"", "a good packet": good, "as much as it announces": TOO_LONG}
    header = bad.length.to_bytes(4, "little")
    it.connection.send((good if bad.behind else b"") + header + follows[bad.follows])
    outcome = trial.end_of(it.connection)
    if it.answers() > (len(it.awaited) if bad.behind else 0):
        outcome = "replies"
    trial.judge(outcome, f"{bad}, on the {channel} channel")
    return True


# Pieces

APART_SECONDS = 0.003
"""Between two pieces, so that TCP does not join them."""
NOTE = {"note": "né 🙂 à Zürich – 東京\u2028"}
"""A member that nobody knows, whose text has characters of two, three and four bytes."""
SLOW_SECONDS = 1.5
"""Longer than all pieces take where the harness is not kept waiting."""
LONGEST = 1000
MANY = LONGEST // 10
"""Pieces between which there is no pause."""
PLACES: dict[str, Callable[[bytes], Iterable[int]]] = {
    "nowhere": lambda data: (),
    "at every byte": lambda data: range(1, len(data)),
    "in the header": lambda data: range(1, 7),
    "inside characters": lambda data: (n for n, byte in enumerate(data) if byte & 0xC0 == 0x80),
    "inside escapes": lambda data: (n for n in range(1, len(data)) if data[n - 1 : n] == b"\\"),
}


class Cuts(NamedTuple):
    """How a stream is cut."""

    where: str | list[int]
    """A name of `PLACES`, or places."""
    pause: float = APART_SECONDS
    """At each cut, in seconds; without any TCP joins what was cut."""
    later: bool = False
    """Not the first that the testee takes on its connection, but what comes after that."""

    def __str__(self) -> str:
        place = ", on a connection that was in use" if self.later else ""
        return f"cut {self.where}, {1000 * self.pause:g} ms apart{place}"


def fewer(case: Any) -> Iterator[Cuts]:
    """The same with a cut less."""
    cuts = Cuts(*case)
    listed = [] if isinstance(cuts.where, str) else cuts.where
    return (cuts._replace(where=where) for where in without_one(listed))


FIRST: list[Any] = [Cuts(name) for name in PLACES]
PAUSES = st.sampled_from((0.0, 0.0005, APART_SECONDS, 0.02))
SOMEWHERE = st.lists(st.integers(1, LONGEST), max_size=6).map(sorted)
ONLY_FIRST = Cases(FIRST, st.tuples(SOMEWHERE, PAUSES), simpler=fewer)
ALSO_LATER = Cases(
    [*FIRST, *(it._replace(later=True) for it in FIRST)],
    st.tuples(SOMEWHERE, PAUSES, st.booleans()),
    simpler=fewer,
)


def in_utf_8(message: Json) -> bytes:
    """A packet with a member that nobody knows, whose characters are not escaped."""
    return packet(spell_in_utf_8(message | NOTE))


def send_cut(trial: Trial, connection: Connection, data: bytes, cuts: Cuts) -> None:
    """Send bytes in pieces; between very many there are no pauses.

    Skips the check if a busy machine makes them last so long that the testee gives them up.
    """
    began = time.monotonic()
    places = PLACES[cuts.where](data) if isinstance(cuts.where, str) else cuts.where
    ends = sorted({place for place in places if 0 < place < len(data)})
    for begin, end in itertools.pairwise([0, *ends, len(data)]):
        connection.send(data[begin:end])
        trial.rest(cuts.pause if len(ends) < MANY else 0.0)
    lasted = (connection.gone_since or began) - began
    if connection.ended and lasted > SLOW_SECONDS:
        trial.not_observable(f"on a busy machine the pieces took {lasted:.1f} s, until it closed")


@check(
    "FRM-4",
    on={
        CLIENT_IPC: DECLARES_HOST_MEMORY,
        CLIENT_DEVICE: DEVICE,
        CLIENT_MSG: ("asks",),
        SERVER_IPC: ("1.1",),
        SERVER_MSG: (),
    },
    given=listening,
    cases={
        CLIENT_IPC: ALSO_LATER._replace(quick=40, full=2000),
        CLIENT_DEVICE: ONLY_FIRST._replace(quick=2, full=300),
        CLIENT_MSG: ONLY_FIRST._replace(quick=3, full=60),
        SERVER_IPC: ONLY_FIRST._replace(quick=10, full=300),
        SERVER_MSG: ALSO_LATER._replace(quick=40, full=1000),
    },
)
def check_any_segmentation(
    trial: Trial, place: Place, listener: DeviceListener | None, case: Cuts
) -> bool:
    """What the testee awaits first on a connection, and what it awaits later, arrives byte by byte,
    cut in the header, inside characters of more than one byte, inside escapes, and anywhere; and
    joined to other packets: memory is opened, a frame released, a request answered.
    """
    cuts = Cuts(*case)
    it = exchange(trial, place, cuts.later, listener)
    if it is None or not it.awaited:
        return False
    joined = isinstance(trial, ClientTrial) and place != "msg"
    messages = [STRANGER, *it.awaited, STRANGER] if joined else it.awaited
    data = b"".join(map(in_utf_8, messages))
    send_cut(trial, it.connection, data, cuts)
    taken = it.taken()
    what = f"{place}: {len(messages)} packets of {len(data)} bytes, {cuts}"
    trial.expect(taken is not False, "not-taken", f"{what}: they were not taken, each once")
    if taken is None and not isinstance(cuts.where, str):  # it can show no more than with these
        trial.not_observable(
            "the testee asks for nothing more after a reply: nothing shows reading"
        )
    return bool(taken)


@check(
    "FRM-4",
    on={CLIENT: ("hello:msg", "returns:msg")},
    given=require_refusal,
    cases=ONLY_FIRST._replace(listed=FIRST[1:], quick=2, full=10),
)
def check_any_segmentation_of_welcome(trial: ClientTrial, control: None, case: Cuts) -> None:
    """A welcome with a version that nobody listed, on which the testee must close the connection
    (NEG-16), is cut as above; it is first seen to do so where the welcome is whole.
    """
    cuts, it = Cuts(*case), refusal(trial)
    data = b"".join(map(in_utf_8, it.awaited))
    send_cut(trial, it.connection, data, cuts)
    outcome = "accepts" if it.taken() else trial.fate() or "hangs"
    trial.judge(outcome, f"a welcome of {len(data)} bytes, {cuts}")


# The greatest length


def versions(trial: ServerTrial) -> list[bool]:
    """Whether hello is said: by no client of 1.0, and by one of 1.1 to a server that knows it."""
    return [False, True] if trial.facts.welcome["msg"] else [False]


BLANK = encode(VIEWPORT_REQUEST).ljust(MOST)
ROOM = MOST - len(encode(VIEWPORT_REQUEST | {"": ""}))
FILLED = encode(VIEWPORT_REQUEST | {"": "x" * ROOM})
LONG_REQUESTS = ((BLANK, MOST // 2), (FILLED, 3), (FILLED, MOST + 2))
"""Each with a place where it is cut."""


@check(
    "FRM-4",
    on={SERVER: ()},
    cases=lambda trial: Cases([*itertools.product(versions(trial), LONG_REQUESTS)]),
)
def check_the_longest_packet(trial: ServerTrial, case: tuple[bool, tuple[bytes, int]]) -> None:
    """A request made as long as a payload may be by white space, or by a member that nobody knows,
    is answered: whole, in two pieces, and joined with the next; before hello, and after it.
    """
    greets, (payload, place) = case
    connection = trial.greeted("msg") if greets else trial.dial("msg")
    send_cut(trial, connection, packet(payload) + REQUEST, Cuts([place], 0.0005))
    trial.wait(lambda: len(trial.replies(connection)) > 1 or connection.ended, 2 * EFFECT_SECONDS)
    trial.expect(
        len(trial.replies(connection)) == 2 and not connection.ended,
        "no-reply",
        f"a request of {MOST:,} bytes and another one, cut at {place}, were not answered",
    )
    connection.close()


@check("FRM-4", on={SERVER_IPC: ("1.1",), SERVER_MSG: ("1.1",)})
def check_the_longest_hello(trial: ServerTrial, channel: Channel) -> None:
    """A `hello` as long as a payload may be has its welcome, on both channels."""
    said = encode(hello(trial.viewer.capabilities[channel], trial.viewer.token))
    connection = trial.before_hello(channel)
    connection.send(packet(said.ljust(MOST)))
    trial.expect(
        trial.is_welcomed(connection),
        "no-welcome",
        f"{channel}: a hello of {MOST:,} bytes has no welcome",
    )
    connection.close()


@check("FRM-4", on={SERVER: ("frames",)})
def check_the_longest_pose(trial: ServerTrial) -> None:
    """The same of poses, of a client of 1.0 and of one of 1.1: a frame shows each."""
    steering = CameraControl(trial)
    poser = trial.dial("msg")
    trial.expect(steering.shows(poser, camera_pose()), "not-applied", "no frame shows a good pose")
    for x, greets in enumerate(versions(trial), 2):
        poser.close()
        poser = trial.greeted("msg") if greets else trial.dial("msg")
        pose = camera_pose((float(x), 0.0, 0.0))
        taken = steering.takes(poser, pose, encode(pose).ljust(MOST))
        trial.judge(taken, f"a pose of {MOST:,} bytes")


# Incomplete packets


DRIP_SECONDS = 1.0
"""Between bytes of a packet that is not complete for half a minute."""
BEGUN = 2
"""So many bytes of the next packet come with the one before."""


@check(
    "FRM-5",
    on={CLIENT: ("ipc",), SERVER: ()},
    cases={CLIENT: Cases((False, True)), SERVER: Cases((True,))},
    profile="full",
)
def check_incomplete_packet_is_given_up(trial: Trial, dribbles: bool) -> None:
    """A packet that stays incomplete for longer than the limit: half of it at once and then
    silence; its first bytes behind a whole one; and one byte more every second. On another
    connection to a server, each packet is complete after a second, and the next begins with it.
    """
    dripping = _incomplete(trial, dribbles)
    steady = _steady(trial)
    began, everyone = trial.peer.clock(), list(dripping)
    for place in itertools.count():
        left = began + LIMIT + EFFECT_SECONDS - trial.peer.clock()
        if left <= 0 or trial.wait(lambda: all(c.ended for c in everyone), min(left, DRIP_SECONDS)):
            break
        for connection, rest in dripping.items():
            connection.send(rest[place : place + 1])
        for connection in steady:
            connection.send(REQUEST[BEGUN:] + REQUEST[:BEGUN])
    trial.wait(trial.fate, REACTION_SECONDS)
    for connection, rest in dripping.items():
        closes = "closes" if connection.ended else "hangs"
        exits = isinstance(trial, ClientTrial) and trial.fate() == "exits"
        how = "of which a byte came every second" if rest else "that came in part"
        what = f"a packet {how}, after {LIMIT} s on the {connection.channel} channel"
        trial.judge(closes if exits else trial.fate() or closes, what)
        connection.close()
    for connection in steady:
        what = "a connection on which each packet was complete after a second was closed"
        trial.expect(not connection.ended, "too-soon", what)
        connection.close()


def _steady(trial: Trial) -> list[Connection]:
    """A connection on which a packet has begun, where a server takes one more."""
    if isinstance(trial, ClientTrial) or any(trial.facts.alone.values()):
        return []
    connection = trial.dial("msg")
    if not trial.answers(connection):
        return []
    connection.send(REQUEST[:BEGUN])
    return [connection]


def _incomplete(trial: Trial, dribbles: bool) -> dict[Connection, bytes]:
    """Connections on which a packet has begun, and what of it is to follow byte by byte."""
    if isinstance(trial, ServerTrial):
        silent = [trial.dial(channel) for channel in CHANNELS]
        for connection in silent:
            behind = REQUEST + REQUEST[:BEGUN]
            connection.send(REQUEST[:16] if connection.channel == "ipc" else behind)
        drips = [] if any(trial.facts.alone.values()) else [trial.dial(it) for it in CHANNELS]
        return dict.fromkeys(silent, b"") | dict.fromkeys(drips, REQUEST)
    trial.role.welcomes = trial.role.offers_memory = False
    data = packet(encode(trial.role.legacy_init_packet()))
    connection = trial.connection("ipc")
    if trial.ends(connection, SETTLE_SECONDS):
        trial.not_observable("the testee closes the ipc channel, whatever comes")
    whole = not dribbles and trial.facts.speaks_1_1("ipc")  # where it is ignored (NEG-9)
    connection.send(packet(encode(STRANGER)) * whole + data[:100])
    return {connection: data[100:] if dribbles else b""}


@check("FRM-5", on={SERVER: ("1.1", "capability:viewport")}, profile="full")
def check_incomplete_packet_behind_another_size(trial: ServerTrial) -> bool:
    """Half a packet in one write with a `set_viewport`, whose reply takes a server time."""
    with resizing(trial) as client:
        width, height = other_sizes(trial)[0]
        heard = trial.with_(client).heard
        before = len(heard)
        request = {"type": "set_viewport", "width": width, "height": height, "id": 1}
        client.send(packet(encode(request)) + REQUEST[:16])
        trial.wait(lambda: len(heard) > before or client.ended, LIMIT)
        trial.wait(lambda: client.ended, LIMIT + EFFECT_SECONDS)
        outcome = trial.fate() or ("closes" if client.ended else "hangs")
        trial.judge(outcome, f"half a packet behind a set_viewport, after {LIMIT} s")
        return len(heard) > before


# Half a packet

PAUSE_SECONDS = 0.02
"""After which TCP has not joined what was sent apart, unless the testee was busy meanwhile."""


def ended_in(case: tuple[int, str]) -> tuple[bool, bool, str]:
    """How far a packet had come, in the header or behind it, and how the connection ended."""
    return case[0] > 3, case[0] > 5, case[1]


@check(
    "FRM-6",
    on={
        CLIENT_IPC: ("ipc", "opens:unless-silent", "reconnects:ipc"),
        CLIENT_DEVICE: (*DEVICE, "reconnects:ipc"),
        CLIENT_MSG: ("asks", "reconnects:msg"),
        SERVER_IPC: ("1.1",),
        SERVER_MSG: (),
    },
    given=listening,
    cases=Cases(
        [*itertools.product((1, 3, 4, 5, 20, 200), ("close", "reset"))], kind=ended_in, spare=2
    ),
    may_crash=True,
)
def check_half_packet_is_discarded(
    trial: Trial, place: Place, listener: DeviceListener | None, case: tuple[int, str]
) -> bool:
    """A connection ends or is reset inside what the testee awaits: at its first byte, in the
    header, in the payload; on the next it must take whole packets. Whoever continues the half finds
    a bad length there, and closes, or waits for what was announced.
    """
    kept, how = case
    it = exchange(trial, place, listener=listener)
    if it is None or not it.awaited:
        trial.not_observable("nobody knows what the testee awaits there")
    it.connection.send(it.packets[0][:-1][:kept])
    trial.rest(PAUSE_SECONDS)
    it.leave(how)
    what = f"{place}: a connection that ends ({how}) after {kept} bytes of a packet"
    trial.wait(trial.fate, ENDING_SECONDS / 10)
    if fate := trial.fate():  # it is started anew for what follows, which would tell nothing
        trial.judge(fate, what)
    outcome = _outcome_anew(trial, place, listener)
    if isinstance(trial, ServerTrial) and how == "reset" and not trial.serves():
        return False  # that is no matter of packets, but of CHN-14
    return judge_if_seen(trial, outcome, f"{what}, and then another")


def _outcome_anew(trial: Trial, place: Place, listener: DeviceListener | None) -> str:
    """What becomes of whole packets on the next connection; nothing where that does not show."""
    if isinstance(trial, ServerTrial):
        it = exchange(trial, place)
        assert it is not None, "a server can always be asked"
        it.connection.send(b"".join(it.packets))
        return "ignores" if it.taken() else trial.end_of(it.connection)
    if place == "ipc":
        tries, came = trial.tries_to_go_on("ipc")
        # Who takes more connections than after whole packets has given one up for the half.
        given_up = came and tries > 1 and tries > trial.tries_to_go_on("ipc")[0]
        return "closes" if given_up else "reconnects" if came else "hangs"
    connection = trial.next_connection("ipc" if listener else "msg")
    if connection is None:
        return "hangs"
    if listener:
        return "reconnects" if listener.opens(connection, listener.image()) else "hangs"
    return _outcome_of_replies(trial, connection)


def _outcome_of_replies(trial: ClientTrial, connection: Connection) -> str:
    for _ in range(PROBES):  # who ends it before anything was sent has read nothing there
        if not trial.ends(connection, REACTION_SECONDS) or connection.sent:
            break
        connection = trial.next_connection("msg") or connection
    it = asked_on(trial, connection)
    connection.send(b"".join(it.packets))
    if (it.taken() if it.awaited else not connection.ended) is False:
        return trial.fate() or ("closes" if connection.ended else "hangs")
    return "ignores" if connection.messages else ""


@check("FRM-6", on={SERVER: ()}, cases=Cases(range(3)), may_crash=True)
def check_cut_request_is_not_answered(trial: ServerTrial, number: int) -> None:
    """Some requests, then one whose last byte is missing, which is white space; then the end."""
    cut = packet(encode(VIEWPORT_REQUEST) + b" ")[:-1]
    connection = trial.dial("msg")
    connection.send(REQUEST * number + cut)
    connection.end_stream()
    trial.ends(connection)
    trial.rest(REACTION_SECONDS / 4)
    replies = len(trial.replies(connection))
    trial.expect(
        replies <= number,
        "unasked-reply",
        f"{replies} replies to {number} whole requests and one that was cut short",
    )
    trial.expect(
        trial.serves(), "not-served", "the server answers nobody after a request was cut short"
    )
