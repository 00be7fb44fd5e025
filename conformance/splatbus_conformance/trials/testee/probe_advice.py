"""What the first meeting with a testee suggests to its author, before any verdict.

Functions from what was seen to sentences.
"""

from collections.abc import Sequence
from typing import NamedTuple

from splatbus_schemas.first_bytes import astray, cut_short, recognised

from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.wire.json_values import strings
from splatbus_conformance.wire.message_kinds import CAPABILITIES, CLIENT_1_0, INIT_MEMBERS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import Connection

OPEN = (
    "SPLATBUS_TOKEN is set here, and the server lets in who does not say it: if it was to require "
    "it, it does not; if not, unset the variable (NEG-18, NEG-19)."
)
BLANK = (
    "The server grants frames and announced no memory to read them from: nothing of its images is "
    "judged. If it makes memory late, for a scene that it still loads, wait for that before it is "
    "met (--connect)."
)
LEFT = (
    "Your client {} while it was served. It has to run until the harness ends it: most of what is "
    "judged comes later."
)
FLOOD = 1000.0
"""Messages a second: a display refreshes 60 to 240 times."""


class ObservedConnection(NamedTuple):
    """One connection, as it was seen while both sides were left alone."""

    channel: Channel
    port: int
    """The harness's."""
    heard: Sequence[Json] = ()
    """The objects that the testee sent."""
    refused: bytes = b""
    """What it sent from a header on that is none."""
    unread: bytes = b""
    """The first payload that is no JSON."""
    ended: bool = False
    """The testee closed it, unasked."""
    offered: str = ""
    """What it was told of images before it closed, last: an init packet or a size; or nothing."""
    failed: str = ""
    """The reason that its `open_failed` gave."""
    process: int | None = None
    """Which process is at the other end, where that is shown."""
    unfinished: bytes = b""
    """What came of a payload that is not complete."""
    rate: float = 0.0
    """Messages a second that came."""


def observed(connection: Connection, port: int) -> ObservedConnection:
    """What came on a connection, for advice; at this port, of the harness or of the testee."""
    unread = (it.packet.payload for it in connection.messages if it.value is None)
    return ObservedConnection(
        connection.channel,
        port,
        [it.value for it in connection.messages if it.value is not None],
        connection.no_packet,
        next(unread, b""),
    )


def on_client(
    met: Sequence[ObservedConnection],
    wanted: dict[Channel, int],
    launched: int | None,
    ended: str = "",
) -> list[str]:
    """What the first meeting suggests to the author of a client.

    Args:
        met: its connections.
        wanted: the port of each channel.
        launched: the process that the harness started, if it has none but this, and processes can
            be told apart here.
        ended: how its process ended while it was served, if it did.
    """
    return [
        *_foreign(met),
        *(_swapped_client(met) or _one_channel(met, wanted)),
        *([LEFT.format(ended)] if ended else _size(met)),
        *_several(met, launched),
        *_flood(met),
    ]


def on_server(
    met: Sequence[ObservedConnection], is_open: bool = False, is_blank: bool = False
) -> list[str]:
    """What the first meeting suggests to the author of a server, or to who started it.

    Args:
        met: its connections.
        is_open: it speaks 1.1, and lets in who lacks the token that is set here.
        is_blank: it granted `frames`, and announced no memory.
    """
    return [*_foreign(met), *_swapped_server(met), *[OPEN] * is_open, *[BLANK] * is_blank]


def _foreign(met: Sequence[ObservedConnection]) -> list[str]:
    """What is no packet, or no JSON, is said once for each channel."""
    found: dict[Channel, str] = {}
    for it in met:
        if it.unread and (known := astray(it.unread, it.refused)):
            told = f"a payload that is no JSON: {it.unread[:12]!r}"
        elif it.refused:
            known = recognised(it.refused)
            told = f"bytes that are no packet: {it.refused[:8].hex(' ')}"
        elif known := cut_short(it.unfinished):
            told = f"a payload of which more was announced: {it.unfinished[:12]!r}"
        else:
            continue
        text = f"On the {WORDS[it.channel]} channel came {told}"
        found.setdefault(it.channel, f"{text}; {known} (FRM-1)." if known else f"{text} (FRM-1).")
    return list(found.values())


def _swapped_client(met: Sequence[ObservedConnection]) -> list[str]:
    for it in met:
        kinds = [message.get("type") for message in it.heard]
        astray = [kind for kind in kinds if it.channel == "ipc" and kind in CLIENT_1_0]
        if astray:
            return [_swapped(f"{astray[0]} came on the IPC channel, port {it.port}")]
        hello = next((message for message in it.heard if message.get("type") == "hello"), None)
        if hello and (of := _others(it.channel, hello)):
            return [_swapped(f"the hello on the {WORDS[it.channel]} channel, port {it.port}, {of}")]
    return []


def _swapped_server(met: Sequence[ObservedConnection]) -> list[str]:
    for it in met:
        if it.channel == "msg" and any(_is_init_packet(message) for message in it.heard):
            return [_swapped(f"an init packet came on the message channel, port {it.port}")]
        welcome = next((message for message in it.heard if message.get("type") == "welcome"), None)
        if welcome and (of := _others(it.channel, welcome)):
            what = f"the welcome on the {WORDS[it.channel]} channel, port {it.port},"
            return [_swapped(f"{what} {of}")]
    return []


def _swapped(what: str) -> str:
    return f"The two ports may be swapped: {what}. --ports takes the IPC port first (6001,6000)."


def _is_init_packet(message: Json) -> bool:
    return message.get("type") is None and any(name in message for name in INIT_MEMBERS)


def _others(channel: Channel, message: Json) -> str:
    """Which capabilities are those of the other channel, if all are."""
    other: Channel = "msg" if channel == "ipc" else "ipc"
    named = set(strings(message.get("capabilities")) or ())
    strange = named & set(CAPABILITIES[other]) if not named & set(CAPABILITIES[channel]) else ()
    return f"lists what belongs to the other: {', '.join(sorted(strange))}" if strange else ""


def _one_channel(met: Sequence[ObservedConnection], wanted: dict[Channel, int]) -> list[str]:
    seen = {it.channel for it in met}
    return [
        f"Nothing connected to the {WORDS[channel]} channel, port {port}: what is said there is "
        "not judged. If your client uses it, look at its port"
        for channel, port in wanted.items()
        if channel not in seen
    ]


def _size(met: Sequence[ObservedConnection]) -> list[str]:
    """Some clients stop when images are not of their own size; others close to begin in earnest."""
    stayed = {it.channel for it in met if not it.ended}
    for it in met:
        if it.failed:
            return [f"Your client could not open the memory of {it.offered}: it says {it.failed!r}"]
        if it.ended and it.offered and it.channel not in stayed:
            return [
                f"Your client closed its {WORDS[it.channel]} connection when it was told of "
                f"{it.offered}. If it insists on the size of its own view, give that: "
                "--viewport 1920x1080"
            ]
    return []


def _flood(met: Sequence[ObservedConnection]) -> list[str]:
    rate = max((it.rate for it in met), default=0.0)
    if rate <= FLOOD:
        return []
    return [
        f"Your client sends {rate:,.0f} messages a second, where a display refreshes 60 to 240 "
        "times: let its loop wait for that. The harness looks at each, so this run takes long"
    ]


def _several(met: Sequence[ObservedConnection], launched: int | None) -> list[str]:
    """Who else connects, such as a client that was left over from before."""
    for channel in WORDS:
        here = [it.process for it in met if it.channel == channel and it.process is not None]
        if len(set(here)) > 1:
            which = " and ".join(map(str, dict.fromkeys(here)))
            return [
                f"Several processes connect to the {WORDS[channel]} channel: {which}. Is one left "
                "over from before? End it: the harness takes all of them for one client"
            ]
    strange = [it.process for it in met if it.process not in (None, launched)]
    if launched is not None and strange:
        return [
            f"Process {strange[0]} connects, which the harness did not start. Is it left over from "
            "before? End it: the harness takes it for your client"
        ]
    return []


def does_not_come(channel: Channel, testee: Testee) -> str:
    """In words, that a client which came back when it was met does so no more."""
    if ended := testee.ended():
        return f"its process {ended}"
    return f"it does not connect to the {WORDS[channel]} channel any more"
