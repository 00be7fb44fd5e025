"""Checks on how servers take packets (spec 1.0 section 2.1)."""

import itertools
import json
import time
from collections.abc import Iterator
from typing import NamedTuple

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.checks import check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.resizing import other_sizes, resizing
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, ENDING_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.messages import Json, encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

LONGEST: int = LIMITS["max_payload_bytes"]
REQUEST = packet(encode(VIEWPORT_REQUEST))
BAD_LENGTHS = (0, LONGEST + 1, 542_393_671, 0xFFFF_FFFF)
SWAPPED = (28 << 24, 1 << 24)
"""Lengths that are good when their bytes are read from the other end."""
SIGNED = (2**31 - 1, 2**31)
KEPT = (1, 3, 4, 5, 20)
"""How many bytes of a packet arrive."""
ENDS = ("close", "reset")
PAUSE_SECONDS = 0.02
"""After which TCP has not joined what was sent apart, unless the server was busy meanwhile."""
DRIP_SECONDS = 3.0
"""Between bytes of a packet that would not be complete for half an hour."""


class BadHeaderInContext(NamedTuple):
    """A header that no packet may have, and what stands around it."""

    channel: Channel
    length: int
    before: bytes = b""
    after: bytes = b""

    def __str__(self) -> str:
        behind = " behind a request" * bool(self.before)
        then = f", and {len(self.after):,} bytes" if self.after else ""
        return f"a header that announces {self.length:,} bytes{behind}{then}"


def bad_headers() -> Iterator[BadHeaderInContext]:
    """Every bad length, on either channel: alone, followed by a request, behind one; and the
    payload that one announces which is a byte too long.
    """
    too_long = encode(VIEWPORT_REQUEST).ljust(LONGEST + 1)
    for channel in CHANNELS:
        for length in (*BAD_LENGTHS, *SWAPPED, *SIGNED):
            yield BadHeaderInContext(channel, length)
            yield BadHeaderInContext(channel, length, after=REQUEST)
        yield BadHeaderInContext(channel, LONGEST + 1, after=too_long)
        yield BadHeaderInContext("msg", 0, before=REQUEST)


def kind_of_header(case: tuple[Channel, int, bytes, bytes]) -> tuple[object, ...]:
    """What is too extreme, or too near to what is right, to stand for another."""
    it = BadHeaderInContext(*case)
    family = it.length if it.length in BAD_LENGTHS else it.length in SWAPPED
    return it.channel, family, bool(it.before), len(it.after) > LONGEST


@check("FRM-3", observable="the server closes the connection and serves another", may_crash=True)
def check_bad_length_closes(trial: ServerTrial) -> None:
    """A header that announces nothing, or more than the limit, on either channel."""
    lengths = st.integers(LONGEST + 1, 0xFFFF_FFFF)
    drawn = st.tuples(st.sampled_from(CHANNELS), lengths, st.just(b""), st.just(REQUEST))
    listed: list[tuple[Channel, int, bytes, bytes]] = list(bad_headers())
    for case in trial.each(listed, drawn, kind=kind_of_header, spare=4, quick=2, full=60):
        bad = BadHeaderInContext(*case)
        connection = trial.dial(bad.channel)
        connection.send(bad.before + bad.length.to_bytes(4, "little") + bad.after)
        most = bool(bad.before)

        def answered() -> bool:
            replies = trial.replies(connection) if bad.channel == "msg" else ()  # noqa: B023
            return len(replies) > most  # noqa: B023

        trial.wait(lambda: answered() or connection.ended)  # noqa: B023
        outcome = "replies" if answered() else trial.end_of(connection, 0.0)
        connection.close()
        trial.judge(outcome, f"{bad} on the {bad.channel} channel")
        trial.delivered += 1


@check("FRM-3", observable="the server closes the connection", may_crash=True)
def check_bad_length_closes_later(trial: ServerTrial) -> None:
    """The same on connections that have been served: a request was answered, or `hello` was."""
    greets = trial.facts.welcome["msg"] is not None
    served: list[tuple[Channel, bool]] = [("msg", False)]
    served += [("msg", True), ("ipc", True)] if greets else []
    for (channel, greeted), length in trial.each(list(itertools.product(served, BAD_LENGTHS))):
        connection = trial.greeted(channel) if greeted else trial.dial(channel)
        if channel == "msg":
            trial.expect(trial.answers(connection), "no reply on the message channel")
        connection.send(length.to_bytes(4, "little"))
        outcome = trial.end_of(connection)
        connection.close()
        trial.judge(
            outcome, f"{BadHeaderInContext(channel, length)} on a connection that was served"
        )
        trial.delivered += 1


TEXTS: tuple[Json, ...] = (
    VIEWPORT_REQUEST,
    VIEWPORT_REQUEST | {"note": "é, Ω, 中, 🙂\u2028"},
    {"type": "get_camera_pose", "cam_idx": 0, "☃": ["\\", '"', "\u007f"]},
)
STREAM = b"".join(
    packet(json.dumps(text, ensure_ascii=escaped).encode())
    for escaped in (False, True)
    for text in TEXTS
)
"""Requests, whose texts have characters of one to four bytes, and escapes."""
EVERY_BYTE = list(range(1, len(STREAM)))
INSIDE = [at for at in EVERY_BYTE if STREAM[at] >> 6 == 2 or STREAM[at - 1 : at] == b"\\"]
"""Places inside of a character, or of an escape."""
Cuts = tuple[list[int], float]
"""Where a stream is cut, and the pause at each cut."""


def cuts(size: int, inside: list[int]) -> st.SearchStrategy[Cuts]:
    """A few cuts, most of them too quick for TCP to keep them apart."""
    place = st.integers(1, size - 1) | st.sampled_from(inside)
    pause = st.sampled_from((0.0, 0.0005, 0.0005, PAUSE_SECONDS))
    return st.tuples(st.lists(place, max_size=6), pause)


def fewer_cuts(case: Cuts) -> Iterator[Cuts]:
    """The same with a cut less."""
    return ((fewer, case[1]) for fewer in without_one(case[0]))


def send_in_pieces(trial: ServerTrial, connection: Connection, data: bytes, case: Cuts) -> str:
    """Send so; in words, how."""
    places = sorted(set(case[0]))
    for begin, end in itertools.pairwise([0, *places, len(data)]):
        connection.send(data[begin:end])
        trial.rest(case[1])
    return f"cut at {places[:8]}, {1000 * case[1]:g} ms apart"


@check("FRM-4", observable="the server answers requests that arrive in pieces")
def check_any_segmentation(trial: ServerTrial) -> None:
    """Requests arrive byte by byte, cut anywhere, also inside of characters and of escapes, and
    several joined.
    """
    connection = trial.dial("msg")
    count = 2 * len(TEXTS)
    listed: list[Cuts] = [(EVERY_BYTE, 0.0), ([], 0.0), *(([at], PAUSE_SECONDS) for at in INSIDE)]
    drawn = cuts(len(STREAM), INSIDE)
    for case in trial.each(
        listed,
        drawn,
        kind=lambda it: len(it[0]),
        spare=6,
        quick=40,
        full=1000,
        simpler=fewer_cuts,
    ):
        before = len(trial.replies(connection))
        told = send_in_pieces(trial, connection, STREAM, case)
        answered = trial.wait(lambda: len(trial.replies(connection)) >= before + count)  # noqa: B023
        trial.expect(answered, f"{count} requests {told} were not answered")
        trial.expect(trial.answers(connection), f"after {count} requests {told}: no reply")
        extra = len(trial.replies(connection)) - before - count - 1
        trial.expect(not extra, f"{count} requests {told} had {extra} replies too many")
        if before > MANY_REPLIES:
            connection.close()
            connection = trial.dial("msg")


MANY_REPLIES = 500


@check(
    "FRM-4",
    observable="the server answers a hello that arrives in pieces, by welcome",
    needs=("1.1",),
)
def check_any_segmentation_on_ipc(trial: ServerTrial) -> None:
    """`hello` on the IPC channel, cut anywhere, and byte by byte."""
    trial.greeted("ipc").close()
    greeting = hello(trial.viewer.capabilities["ipc"], trial.viewer.token)
    greeting["client"] = {"name": "é, Ω, 中, 🙂", "version": "1"}
    said = packet(json.dumps(greeting, ensure_ascii=False).encode())
    inside = [at for at in range(1, len(said)) if said[at] >> 6 == 2]
    listed: list[Cuts] = [(list(range(1, len(said))), 0.0)]
    listed += [([at], PAUSE_SECONDS) for at in inside]
    for case in trial.each(
        listed,
        cuts(len(said), inside),
        kind=lambda it: len(it[0]),
        spare=2,
        quick=10,
        full=300,
        simpler=fewer_cuts,
    ):
        connection = trial.before_hello("ipc")
        told = send_in_pieces(trial, connection, said, case)
        dealings = trial.viewer.with_(connection)
        trial.wait(lambda: dealings.welcome or connection.ended)  # noqa: B023
        trial.expect(dealings.welcome, f"a hello {told} has no welcome")
        connection.close()
        trial.delivered += 1


@check(
    "FRM-5",
    observable="the server closes connections on which a packet stays incomplete",
    profile="full",
)
def check_incomplete_packet_is_given_up(trial: ServerTrial) -> None:
    """A packet on each channel that stays incomplete for longer than the limit: half of it at once
    and then silence; its first bytes behind a whole one; and a byte of it every three seconds.
    """
    silent = [trial.dial(channel) for channel in CHANNELS]
    dripping = [] if any(trial.facts.alone.values()) else [trial.dial(it) for it in CHANNELS]
    for connection in silent:
        connection.send(REQUEST[:16] if connection.channel == "ipc" else REQUEST + REQUEST[:2])
    limit = LIMITS["packet_completion_seconds"]
    everyone, began = [*silent, *dripping], time.monotonic()
    for byte in range(len(REQUEST) - 1):
        left = began + limit + EFFECT_SECONDS - time.monotonic()
        for connection in dripping:
            connection.send(REQUEST[byte : byte + 1])
        if left <= 0 or trial.wait(lambda: all(c.ended for c in everyone), min(left, DRIP_SECONDS)):
            break
    for connection in everyone:
        outcome = trial.fate() or ("closes" if connection.ended else "waits")
        how = "of which a byte came every 3 s" if connection in dripping else "that came in part"
        what = f"a packet {how}, after {limit} s on the {connection.channel} channel"
        trial.judge(outcome, what)
        trial.delivered += 1
        connection.close()
    trial.expect(trial.serves(), "the server answers nobody after half a packet")


@check(
    "FRM-5",
    observable="the server closes the connection on which a packet stays incomplete",
    needs=("1.1", "capability:viewport"),
    profile="full",
)
def check_incomplete_packet_behind_another_size(trial: ServerTrial) -> None:
    """Half a packet in one write with a `set_viewport`, whose reply takes a server time."""
    limit = LIMITS["packet_completion_seconds"]
    with resizing(trial) as client:
        width, height = other_sizes(trial)[0]
        heard = trial.viewer.with_(client).heard
        before = len(heard)
        request = {"type": "set_viewport", "width": width, "height": height, "id": 1}
        client.send(packet(encode(request)) + REQUEST[:16])
        trial.wait(lambda: len(heard) > before or client.ended, limit)
        trial.wait(lambda: client.ended, limit + EFFECT_SECONDS)
        outcome = trial.fate() or ("closes" if client.ended else "waits")
        trial.judge(outcome, f"half a packet behind a set_viewport, after {limit} s")
        trial.delivered += len(heard) > before


@check(
    "FRM-6",
    observable="the server answers a whole request on the next connection, and no more than that",
    may_crash=True,
)
def check_half_packet_is_discarded(trial: ServerTrial) -> None:
    """A connection ends or is reset inside a request: at its first byte, in the header, in the
    payload.
    """
    cases = [(kept, end) for end in ENDS for kept in KEPT]
    for kept, end in trial.each(cases, kind=lambda it: it[1], spare=4):
        connection = trial.dial("msg")
        connection.send(REQUEST[:kept])
        trial.rest(PAUSE_SECONDS)
        end_by(connection, end)
        _expect_alive(trial, f"a connection that ends ({end}) after {kept} bytes of a request")
        following = trial.dial("msg")
        outcome = trial.outcome_on_msg(following)
        following.close()
        if end == "reset" and not trial.serves():
            continue  # that is no matter of packets, but of CHN-14
        what = f"a connection that ends ({end}) after {kept} bytes of a request, and then another"
        trial.judge(outcome, what)


@check(
    "FRM-6",
    observable="the server welcomes the next client on the IPC channel",
    needs=("1.1",),
    may_crash=True,
)
def check_half_hello_is_discarded(trial: ServerTrial) -> None:
    """The same on the IPC channel, inside of `hello`."""
    trial.greeted("ipc").close()
    said = packet(encode(hello([], trial.viewer.token)))
    cases = [(kept, end) for end in ENDS for kept in (*KEPT, len(said) - 1)]
    for kept, end in trial.each(cases, kind=lambda it: it[1], spare=4):
        connection = trial.before_hello("ipc")
        connection.send(said[:kept])
        trial.rest(PAUSE_SECONDS)
        end_by(connection, end)
        _expect_alive(trial, f"a connection that ends ({end}) after {kept} bytes of hello")
        following, answer = trial.answered("ipc")
        what = f"a connection that ends ({end}) after {kept} bytes of hello, and then another one"
        welcomed = (answer or {}).get("type") == "welcome"
        trial.judge(trial.fate() or ("ignores" if welcomed else "hangs"), what)
        trial.delivered += 1
        following.close()


def _expect_alive(trial: ServerTrial, what: str) -> None:
    """A server that has ended is started anew for what follows, which would tell nothing."""
    trial.wait(trial.fate, ENDING_SECONDS / 10)
    if fate := trial.fate():
        trial.judge(fate, what)


def end_by(connection: Connection, how: str) -> None:
    """Close a connection, or reset it."""
    if how == "reset":
        connection.reset()
    else:
        connection.close()


@check(
    "FRM-6",
    observable="the server answers what came whole, and nothing else, before it closes",
    may_crash=True,
)
def check_cut_request_is_not_answered(trial: ServerTrial) -> None:
    """A request, then one whose last byte is missing, which is white space; then the end."""
    cut = packet(encode(VIEWPORT_REQUEST) + b" ")[:-1]
    for number in trial.each(range(3)):
        connection = trial.dial("msg")
        connection.send(REQUEST * number + cut)
        connection.end_stream()
        trial.ends(connection)
        trial.rest(REACTION_SECONDS / 4)
        replies = len(trial.replies(connection))
        trial.expect(
            replies <= number,
            f"{replies} replies to {number} whole requests and one that was cut short",
        )
        trial.expect(trial.serves(), "the server answers nobody after a request was cut short")
