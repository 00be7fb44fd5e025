"""Packets that a server is not sent whole (spec 1.0 section 2.1)."""

import time
from operator import itemgetter

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, SERVER_IPC, SERVER_MSG, Cases, check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.exchanges.exchange import with_a_server
from splatbus_conformance.trials.moves.resizing import other_sizes, resizing
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, ENDING_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS

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
    on={SERVER: ()},
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
    on={SERVER: ("1.1", "capability:viewport")},
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


INSIDE = [(kept, end) for end in ENDS for kept in KEPT]


@check(
    "FRM-6",
    observable="the server takes a whole request or hello on the next connection, and no more",
    on={SERVER_IPC: ("1.1",), SERVER_MSG: ()},
    cases={
        SERVER_IPC: Cases([*INSIDE, *((-1, end) for end in ENDS)], kind=itemgetter(1), spare=4),
        SERVER_MSG: Cases(INSIDE, kind=itemgetter(1), spare=4),
    },
    may_crash=True,
)
def check_half_packet_is_discarded(
    trial: ServerTrial, channel: Channel, case: tuple[int, str]
) -> None:
    """A connection ends or is reset inside a request or `hello`: at its first byte, in the header,
    in the payload.
    """
    kept, end = case
    it = with_a_server(trial, channel, later=False)
    if not it.awaited:
        trial.not_observable("the server says no welcome on the IPC channel")
    whole = [packet(encode(message)) for message in it.awaited]
    it.connection.send(whole[0][:kept])
    trial.rest(PAUSE_SECONDS)
    getattr(it.connection, end)()
    what = f"a connection on the {channel} channel that ends ({end}) after {kept} bytes of a packet"
    trial.wait(trial.fate, ENDING_SECONDS / 10)
    if fate := trial.fate():  # it is started anew for what follows, which would tell nothing
        trial.judge(fate, what)
    it = with_a_server(trial, channel, later=False)
    it.connection.send(b"".join(whole))
    outcome = "ignores" if it.taken() else trial.end_of(it.connection)
    if end == "reset" and not trial.serves():
        return  # that is no matter of packets, but of CHN-14
    trial.judge(outcome, f"{what}, and then another")
    trial.delivered += 1


@check(
    "FRM-6",
    on={SERVER: ()},
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
