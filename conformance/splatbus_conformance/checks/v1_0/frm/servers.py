"""Packets that a server is not sent whole (spec 1.0 section 2.1)."""

import time

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.resizing import other_sizes, resizing
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, ENDING_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.messages import encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import CHANNELS, Connection

REQUEST = packet(encode(VIEWPORT_REQUEST))
KEPT = (1, 3, 4, 5, 20)
"""How many bytes of a packet arrive."""
ENDS = ("close", "reset")
PAUSE_SECONDS = 0.02
"""After which TCP has not joined what was sent apart, unless the server was busy meanwhile."""
DRIP_SECONDS = 3.0
"""Between bytes of a packet that would not be complete for half an hour."""


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
        outcome = trial.fate() or ("closes" if connection.ended else "hangs")
        how = "of which a byte came every 3 s" if connection in dripping else "that came in part"
        what = f"a packet {how}, after {limit} s on the {connection.channel} channel"
        trial.judge(outcome, what)
        trial.delivered += 1
        connection.close()
    trial.expect(trial.serves(), "not-served", "the server answers nobody after half a packet")


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
        outcome = trial.fate() or ("closes" if client.ended else "hangs")
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
            "unasked-reply",
            f"{replies} replies to {number} whole requests and one that was cut short",
        )
        trial.expect(
            trial.serves(), "not-served", "the server answers nobody after a request was cut short"
        )
