"""Captures of network traffic (pcap, pcapng), read as recordings."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from splatbus_conformance.wire.capture.loose import whole_packets
from splatbus_conformance.wire.capture.segments import (
    SECOND,
    CaptureError,
    Endpoint,
    Segment,
    accepting,
    is_capture,
    segments,
)
from splatbus_conformance.wire.capture.streams import Followed, followed, parted
from splatbus_conformance.wire.recording import Channel, Entry

__all__ = ["Capture", "CaptureError", "is_capture", "load", "put_together"]

MOST_SEGMENTS, MOST_BYTES = 500_000, 1 << 26
"""On both channels together: a capture of days must not fill the memory. So many messages take
about a gigabyte to judge."""
MOST_PORTS = 12


class Capture(NamedTuple):
    """What a capture holds of SplatBus."""

    sessions: list[list[Entry]]
    """Each as a recording of its own. One has all connections to one server, or just one connection
    where something is missing: nothing says what another was told in the meantime."""
    messages: list[Entry]
    """Whole messages of connections of which something before them is missing."""
    left_over: tuple[str, ...]
    """What could not be read as it was sent, in words."""


@dataclass(frozen=True, eq=False)
class _Numbered:
    channel: Channel
    number: int
    seen: Followed


def load(path: Path, ipc_port: int, message_port: int) -> Capture:
    """Read a capture of a server at these ports; times count from its first frame.

    Raises:
        CaptureError: it is none that tshark can read, or nothing in it is of these ports.
        OSError: it cannot be read.
    """
    channels: dict[int, Channel] = {ipc_port: "ipc", message_port: "msg"}
    notes: list[str] = []
    found = put_together(segments(path, channels, notes), channels)
    if not (found.sessions or found.messages):
        raise CaptureError(_nothing_found(path, ipc_port, message_port))
    return found._replace(left_over=(*found.left_over, *notes))


def put_together(sent: Iterable[Segment], channels: Mapping[int, Channel]) -> Capture:
    """What is told by the segments from and to a server's ports."""
    few = _Few(sent)
    found = _numbered(few, channels)
    is_whole = all(each.seen.lost is None for each in found)
    sessions: dict[object, list[Entry]] = {}
    messages: list[Entry] = []
    left_over = []
    for each in found:
        if each.seen.is_begun:
            name = each.seen.server[0] if is_whole else each
            sessions.setdefault(name, []).extend(_entries(each))
        if each.seen.lost is not None:
            pieces, others = _messages(each)
            messages += pieces
            left_over.append(_in_words(each, len(pieces), others))
    if few.stopped is not None:
        left_over.append(
            f"what came after {few.stopped / SECOND:.4f} s, when the channels had"
            f" {MOST_SEGMENTS:,} segments, or {MOST_BYTES:,} bytes; `editcap -i SECONDS` parts a"
            " capture"
        )
    in_order = [sorted(entries, key=_time) for entries in sessions.values()]
    return Capture(in_order, sorted(messages, key=_time), tuple(left_over))


def _numbered(sent: Iterable[Segment], channels: Mapping[int, Channel]) -> list[_Numbered]:
    counts: Counter[Channel] = Counter()
    found = []
    for connection in parted(sent):
        server = _server(connection, channels)
        if (seen := followed(connection, server)) is not None:
            channel = channels[server[1]]
            counts[channel] += 1
            found.append(_Numbered(channel, counts[channel], seen))
    return found


class _Few:
    """No more segments than can be judged, and when it was too many."""

    def __init__(self, sent: Iterable[Segment]) -> None:
        self.stopped: int | None = None
        self._sent = sent

    def __iter__(self) -> Iterator[Segment]:
        size = 0
        for count, each in enumerate(self._sent, 1):
            size += len(each.data)
            if size > MOST_BYTES or count > MOST_SEGMENTS:
                self.stopped = each.ns
                return
            yield each


def _server(connection: list[Segment], ports: Mapping[int, Channel]) -> Endpoint:
    """The end that has one of the ports; of two, the one that is connected to."""
    first = connection[0]
    answers = first.syn and first.ack is not None
    ends = (first.source, first.target) if answers else (first.target, first.source)
    return next(end for end in ends if end[1] in ports)


def _entries(each: _Numbered) -> Iterator[Entry]:
    of = each.channel, each.number
    yield Entry(each.seen.opened / SECOND, *of, event="open")
    for ns, direction, data, event in each.seen.pieces:
        yield Entry(ns / SECOND, *of, direction, data, event)


def _messages(each: _Numbered) -> tuple[list[Entry], int]:
    found, others = [], 0
    for run in each.seen.runs:
        packets, more = whole_packets(run)
        found += [
            Entry(it.ns / SECOND, each.channel, each.number, it.direction, it.data)
            for it in packets
        ]
        others += more
    return found, others


def _in_words(each: _Numbered, messages: int, others: int) -> str:
    address, port = each.seen.client
    assert each.seen.lost is not None
    why = "the capture begins in the middle of it"
    if each.seen.is_begun:
        after = each.seen.lost / SECOND
        why = f"segments are missing after {after:.4f} s, whether lost or not captured"
    return (
        f"{each.channel} #{each.number}, of {address} port {port}, as a whole: {why}. "
        f"Behind that {messages:,} messages were judged one by one, and {others:,} bytes not read"
    )


def _nothing_found(path: Path, ipc_port: int, message_port: int) -> str:
    text = f"{path}: no connection to TCP port {ipc_port} (IPC) or {message_port}"
    text += " (messages) in it"
    if not (ports := accepting(path)):
        return f"{text}, and no TCP at all: capture where client or server runs, `tcpdump -i any`"
    more = ", and others" if len(ports) > MOST_PORTS else ""
    most = ", ".join(map(str, ports[:MOST_PORTS]))
    return f"{text}; it has TCP ports {most}{more}: name yours with --ports IPC,MSG"


def _time(entry: Entry) -> float:
    return entry.t
