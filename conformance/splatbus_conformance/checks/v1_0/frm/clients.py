"""Checks on packets (spec 1.0 section 2.1)."""

import itertools
from collections.abc import Callable, Iterable
from typing import NamedTuple

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.spelling import spell_in_utf_8
from splatbus_conformance.checks import DECLARES_HOST_MEMORY, OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.v1_0.chn.clients import closing
from splatbus_conformance.checks.v1_0.req.clients import asking, requests
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.returning import PROBES, tries_to_go_on
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.messages import Json, encode, welcome
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

APART_SECONDS = 0.003
"""Between two pieces, so that TCP does not join them."""
STRANGER = packet(encode({"type": "weather_report"}))
"""A packet that is ignored, for another to be joined to."""
MOST: int = LIMITS["max_payload_bytes"]
NOTE = {"note": "né 🙂 à Zürich – 東京"}
"""A member that nobody knows, whose text has characters of two, three and four bytes."""
LONGEST = 1000
Cuts = str | list[int]
"""Where to cut: a name of `PLACES`, or places."""


class BadHeader(NamedTuple):
    """A header that announces no payload that there may be, and what follows it."""

    kind: str
    length: int
    follows: bytes = b""

    @property
    def what(self) -> str:
        """It in words."""
        return f"a header that announces {self.length:,} bytes"

    @property
    def data(self) -> bytes:
        """As it is sent."""
        return self.length.to_bytes(4, "little") + self.follows


BAD_HEADERS = (
    BadHeader("nothing", 0),
    BadHeader("one too many", MOST + 1),
    BadHeader("the most that 32 bits hold", 0xFFFF_FFFF),
    BadHeader("another", 542_393_671, b" / HTTP/1.1\r\n\r\n"),
    BadHeader("another", 0x7FFF_FFFF),
    BadHeader("another", 0x8000_0000),
    BadHeader("another", 0xFFFF_FF00),
)
PLACES: dict[str, Callable[[bytes], Iterable[int]]] = {
    "nowhere": lambda data: (),
    "at every byte": lambda data: range(1, len(data)),
    "in the header": lambda data: range(1, 7),
    "inside characters": lambda data: (n for n, byte in enumerate(data) if byte & 0xC0 == 0x80),
}
NAMED: list[Cuts] = list(PLACES)
SOMEWHERE: st.SearchStrategy[Cuts] = st.lists(st.integers(1, LONGEST), max_size=6).map(sorted)


def fewer_cuts(cuts: Cuts) -> list[Cuts]:
    """Simpler ones."""
    return [] if isinstance(cuts, str) else list(without_one(cuts))


def send_cut(trial: ClientTrial, connection: Connection, data: bytes, cuts: Cuts) -> None:
    """Send bytes in pieces; there are pauses between them that keep TCP from joining them, except
    where there are very many.
    """
    places = PLACES[cuts](data) if isinstance(cuts, str) else cuts
    ends = sorted({place for place in places if 0 < place < len(data)})
    pause = APART_SECONDS if len(ends) < LONGEST / 10 else 0.0
    for begin, end in itertools.pairwise([0, *ends, len(data)]):
        connection.send(data[begin:end])
        trial.rest(pause)


def closed_by(trial: ClientTrial, connection: Connection) -> str:
    """As `closing`, within the time that a close may take; to end in an orderly way closes too, and
    may be seen before its connection is.
    """
    outcome = closing(trial, connection, EFFECT_SECONDS)
    return "closes" if outcome == "hangs" and connection.ended else outcome


def outcome_of_bad_length(trial: ClientTrial, connection: Connection) -> str:
    """What the testee does after a bad header on the message channel, as `outcome_on_msg`.

    That it closes shows without its return; where it is known to return, it has to.
    """
    outcome = closed_by(trial, connection)
    if outcome == "hangs" or (outcome == "closes" and "msg" in trial.facts.returns):
        return trial.outcome_on_msg(connection)
    trial.delivered += outcome == "closes"
    return outcome


@check(
    "FRM-3",
    observable="the testee closes the connection and connects again",
    needs=(*OPENS_HOST_MEMORY, "returns:ipc"),
    may_crash=True,
)
def check_bad_length_closes_ipc(trial: ClientTrial) -> None:
    """A header that announces nothing, or more than the limit, makes the testee close: in place of
    the init packet, and once the memory is open.
    """
    trial.role.offers_memory = False
    cases = list(itertools.product(BAD_HEADERS, (False, True)))
    for header, late in trial.each(cases, kind=lambda case: (case[0].kind, case[1])):
        connection = trial.greeted("ipc")
        if late:
            trial.role.offer(connection, trial.role.init_packet(connection))
            if not trial.opens(connection):
                trial.not_observable("the testee did not open the memory")
        outcome = trial.outcome_on_ipc(connection, header.data)
        trial.judge(outcome, header.what + (", once the memory was open" if late else ""))


@check(
    "FRM-3",
    observable="the testee closes the connection",
    needs=("asks",),
    may_crash=True,
)
def check_bad_length_closes_message_channel(trial: ClientTrial) -> None:
    """The same on the message channel, in place of a reply."""
    for header in trial.each(BAD_HEADERS, kind=lambda header: header.kind):
        connection = asking(trial)
        connection.send(header.data)  # what was under way may still arrive before it closes
        outcome = outcome_of_bad_length(trial, connection)
        trial.judge(outcome, f"{header.what}, in place of a reply")


@check(
    "FRM-4",
    observable="the testee opens memory whose init packet arrived in pieces, and releases frames",
    needs=DECLARES_HOST_MEMORY,
)
def check_any_segmentation(trial: ClientTrial) -> None:
    """Init packets and frames arrive byte by byte, cut in the header, inside characters of more
    than one byte, and anywhere, and joined to others.
    """
    trial.role.offers_memory = trial.role.lends_frames = False
    for cuts in trial.each(NAMED, SOMEWHERE, quick=20, full=1000, simpler=fewer_cuts):
        connection = trial.for_init_packet()
        offered = STRANGER + in_utf_8(trial.role.init_packet(connection)) + STRANGER
        send_cut(trial, connection, offered, cuts)
        opened = trial.opens(connection)
        what = f"of {len(offered)} bytes, cut {cuts}"
        trial.expect(opened, f"an init packet {what}, was not opened")
        if "frames" in trial.role.with_(connection).granted:
            frame = trial.role.next_frame(connection)
            send_cut(trial, connection, STRANGER + in_utf_8(frame) + STRANGER, cuts)
            released = trial.releases(connection, frame["seq"])
            trial.expect(released, f"a frame, cut {cuts}, was not released")
        trial.delivered += 1


def in_utf_8(message: Json) -> bytes:
    """A packet with a member that nobody knows, whose characters are not escaped."""
    return packet(spell_in_utf_8(message | NOTE))


@check(
    "FRM-4",
    observable="the testee obeys NEG-16 on a welcome that arrived in pieces",
    needs=("hello:msg", "returns:msg"),
)
def check_any_segmentation_of_welcome(trial: ClientTrial) -> None:
    """A welcome with a version that nobody listed, on which the testee must close the connection,
    is cut as above; it is first seen to do so where the welcome is whole.
    """
    trial.role.welcomes = trial.role.replies = False
    data = in_utf_8(welcome("msg", [], "9.9"))
    cases = trial.each(NAMED[1:], SOMEWHERE, quick=2, full=10, simpler=fewer_cuts)
    for cuts in itertools.chain(NAMED[:1], cases):
        connection = trial.connection("msg")
        if not trial.says_hello(connection) or connection.ended:
            trial.not_observable("the testee said no hello on the msg channel, or closed by itself")
        send_cut(trial, connection, data, cuts)
        closes = trial.ends(connection)
        if cuts == "nowhere" and not closes:
            trial.not_observable("the testee does not close on a version that it did not list")
        leaves = closes and trial.facts.leaves and trial.fate() == "exits"
        outcome = (None if leaves else trial.fate()) or ("accepts" if closes else "hangs")
        trial.judge(outcome, f"a welcome of {len(data)} bytes, cut {cuts}")
        trial.delivered += cuts != "nowhere"
        trial.reassure("msg")


@check(
    "FRM-4",
    observable="the testee asks on after replies that arrived in pieces, as after whole ones",
    needs=("asks",),
)
def check_any_segmentation_of_replies(trial: ClientTrial) -> None:
    """Replies cut and joined. Whoever asks for more only after a reply, or again after the size
    [0,0], shows by that that it has read one; first where it is whole. Others must at least keep
    the connection.
    """
    trial.role.width = trial.role.height = 0
    shows = False
    cases = trial.each(NAMED[1:], SOMEWHERE, quick=3, full=60, simpler=fewer_cuts)
    for cuts in itertools.chain(NAMED[:1], cases):
        if not (shows or isinstance(cuts, str)):
            break  # to keep the connection is all that it can show
        connection = asking(trial)
        trial.role.replies = False
        trial.rest(REACTION_SECONDS)
        asked = requests(trial, connection)
        replies = [trial.role.answer(connection, request) for request in asked]
        send_cut(trial, connection, b"".join(in_utf_8(it) for it in replies if it), cuts)
        trial.wait(
            lambda: len(requests(trial, connection)) > len(asked) or connection.ended,  # noqa: B023
            EFFECT_SECONDS if shows or cuts == "nowhere" else REACTION_SECONDS,
        )
        more = len(requests(trial, connection)) > len(asked)
        if cuts == "nowhere":
            shows, kept = more, not connection.ended
            if not kept:
                trial.not_observable("the testee closes the connection after a whole reply")
            continue
        outcome = trial.fate() or ("closes" if connection.ended else "accepts")
        if shows and not more and outcome == "accepts":
            outcome = "hangs"
        trial.judge(outcome, f"replies to {len(asked)} requests, cut {cuts}")
        trial.delivered += shows
    if not shows:
        trial.not_observable(
            "the testee asks for nothing more after a reply: nothing shows reading"
        )


@check(
    "FRM-5",
    observable="the testee closes a connection on which a packet stays incomplete",
    needs=("ipc",),
    profile="full",
)
def check_incomplete_packet_is_given_up(trial: ClientTrial) -> None:
    """A header and half a payload, then silence for longer than the limit; then the same with one
    byte more every second.
    """
    trial.role.welcomes = trial.role.offers_memory = False
    data = packet(encode(trial.role.legacy_init_packet()))
    limit = LIMITS["packet_completion_seconds"]
    for dribbles in (False, True):
        connection = trial.connection("ipc")
        if trial.ends(connection, SETTLE_SECONDS):
            trial.not_observable("the testee closes the ipc channel, whatever comes")
        connection.send(data[:100])
        for place in range(100, 100 + int(limit) if dribbles else 100):
            if not trial.ends(connection, 1.0):
                connection.send(data[place : place + 1])
        left = LIMITS["close_seconds"] + (0 if dribbles else limit)
        outcome = closing(trial, connection, left)
        what = f"a packet that stays incomplete for more than {limit} s"
        trial.judge(outcome, what + (", with a byte a second" if dribbles else ""))
        trial.delivered += 1


ENDS = tuple((kept, end) for kept in (1, 3, 4, 5, 200) for end in ("close", "reset"))
"""Bytes of a packet, and how the connection ends after them."""


def inside(case: tuple[int, str]) -> tuple[bool, str]:
    """Whether the header had come whole, and how the connection ended."""
    return case[0] > 4, case[1]


@check(
    "FRM-6",
    observable="after half an init packet and a new connection, the testee opens a whole one",
    needs=(*OPENS_HOST_MEMORY, "reconnects:ipc"),
    may_crash=True,
)
def check_half_packet_is_discarded(trial: ClientTrial) -> None:
    """The connection ends inside an init packet, at the first byte, in the header and later; it is
    closed or reset. A testee that takes more connections to go on than after whole packets has
    given one up for what was left of the packet.
    """
    trial.role.offers_memory = False
    trial.greeted("ipc").close()
    usual, _ = tries_to_go_on(trial, "ipc")
    for kept, end in trial.each(ENDS, kind=inside):
        connection = trial.greeted("ipc")
        connection.send(packet(encode(trial.role.init_packet(connection)))[:kept])
        trial.rest(APART_SECONDS)
        getattr(connection, end)()
        tries, came = tries_to_go_on(trial, "ipc")
        outcome = "reconnects" if came else trial.fate() or "hangs"
        what = f"a connection that ends after {kept} bytes of a packet, by {end}"
        trial.judge(outcome if tries <= usual else "closes", what)


@check(
    "FRM-6",
    observable="after half a reply and a new connection, the testee takes whole ones",
    needs=("asks", "reconnects:msg"),
    may_crash=True,
)
def check_half_reply_is_discarded(trial: ClientTrial) -> None:
    """The connection ends inside the reply that is awaited. Whoever continues it with what comes on
    the next connection finds a bad length there, and closes.
    """
    for kept, end in trial.each(ENDS, kind=inside):
        connection = asking(trial)
        trial.role.replies = False
        (request, *_) = requests(trial, connection)
        reply = packet(encode(trial.role.answer(connection, request) or {}))
        connection.send(reply[: min(kept, len(reply) - 1)])
        trial.rest(APART_SECONDS)
        trial.role.replies = True
        getattr(connection, end)()
        again = trial.next_connection("msg")
        for _ in range(PROBES):  # who ends it before anything was sent has read nothing there
            if again and trial.ends(again, REACTION_SECONDS) and not again.sent:
                again = trial.next_connection("msg")
        what = f"a connection that ends after {kept} bytes of a reply, by {end}"
        if again is None:
            trial.judge(trial.fate() or "hangs", what)
        elif trial.ends(again, REACTION_SECONDS):
            trial.judge(trial.fate() or "closes", f"{what}: on the next connection")
        else:
            trial.delivered += bool(again.packets)
