"""Captures of network traffic (pcap, pcapng), read as recordings."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from splatbus_conformance.wire.capture.files import SECOND, CaptureError, frames, is_capture
from splatbus_conformance.wire.capture.headers import LINKS, Endpoint, Segment, segment
from splatbus_conformance.wire.capture.loose import whole_packets
from splatbus_conformance.wire.capture.streams import Followed, followed, parted
from splatbus_conformance.wire.recording import Channel, Entry

__all__ = ["Capture", "CaptureError", "is_capture", "load"]

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
        CaptureError: the file breaks its format, or nothing in it is of these ports.
        OSError: it cannot be read.
    """
    channels: dict[int, Channel] = {ipc_port: "ipc", message_port: "msg"}
    reader = _Reader(path, channels)
    found = _numbered(reader.segments(), channels)
    if not found:
        raise CaptureError(_nothing_found(reader, ipc_port, message_port))
    is_whole = all(each.seen.lost is None for each in found)
    sessions: dict[object, list[Entry]] = {}
    messages: list[Entry] = []
    left_over = []
    for each in found:
        if each.seen.is_begun:
            name = each.seen.server[0] if is_whole else each
            sessions.setdefault(name, []).extend(_entries(each, reader.zero))
        if each.seen.lost is not None:
            pieces, others = _messages(each, reader.zero)
            messages += pieces
            left_over.append(_in_words(each, reader.zero, len(pieces), others))
    if reader.stopped is not None:
        t = (reader.stopped - reader.zero) / SECOND
        left_over.append(
            f"what came after {t:.4f} s, when the channels had {MOST_SEGMENTS:,} segments, or "
            f"{MOST_BYTES:,} bytes; `editcap -i SECONDS` parts a capture"
        )
    in_order = [sorted(entries, key=_time) for entries in sessions.values()]
    return Capture(in_order, sorted(messages, key=_time), tuple(left_over))


def _numbered(segments: Iterable[Segment], channels: dict[int, Channel]) -> list[_Numbered]:
    counts: Counter[Channel] = Counter()
    found = []
    for connection in parted(segments):
        server = _server(connection, channels)
        if (seen := followed(connection, server)) is not None:
            channel = channels[server[1]]
            counts[channel] += 1
            found.append(_Numbered(channel, counts[channel], seen))
    return found


class _Reader:
    """Reads the segments of some ports, and keeps in mind what else there is."""

    def __init__(self, path: Path, ports: dict[int, Channel]) -> None:
        self.zero = 0
        self.stopped: int | None = None
        self.accepting: Counter[int] = Counter()
        """TCP ports that took connections, or seem to, each with its segments."""
        self.strange: set[int] = set()
        """Kinds of links that cannot be read."""
        self.path, self._ports = path, ports

    def segments(self) -> Iterator[Segment]:
        """Those of the ports, up to so many bytes; their clock never goes back."""
        now: int | None = None
        size = count = 0
        for frame in frames(self.path):
            if now is None:
                now = self.zero = frame.ns
            now = max(now, frame.ns)
            if frame.link not in LINKS:
                self.strange.add(frame.link)
            if (it := segment(frame._replace(ns=now))) is None:
                continue
            ends = it.source[1], it.target[1]
            self.accepting[ends[0] if it.syn and it.ack is not None else min(ends)] += 1
            if not self._ports.keys() & ends:
                continue
            size += len(it.data)
            count += 1
            if size > MOST_BYTES or count > MOST_SEGMENTS:
                self.stopped = now
                return
            yield it


def _server(connection: list[Segment], ports: dict[int, Channel]) -> Endpoint:
    """The end that has one of the ports; of two, the one that is connected to."""
    first = connection[0]
    answers = first.syn and first.ack is not None
    ends = (first.source, first.target) if answers else (first.target, first.source)
    return next(end for end in ends if end[1] in ports)


def _entries(each: _Numbered, zero: int) -> Iterator[Entry]:
    of = each.channel, each.number
    yield Entry((each.seen.opened - zero) / SECOND, *of, event="open")
    for ns, direction, data, event in each.seen.pieces:
        yield Entry((ns - zero) / SECOND, *of, direction, data, event)


def _messages(each: _Numbered, zero: int) -> tuple[list[Entry], int]:
    found, others = [], 0
    for run in each.seen.runs:
        packets, more = whole_packets(run)
        found += [
            Entry((it.ns - zero) / SECOND, each.channel, each.number, it.direction, it.data)
            for it in packets
        ]
        others += more
    return found, others


def _in_words(each: _Numbered, zero: int, messages: int, others: int) -> str:
    address, port = each.seen.client
    assert each.seen.lost is not None
    why = "the capture begins in the middle of it"
    if each.seen.is_begun:
        after = (each.seen.lost - zero) / SECOND
        why = f"segments are missing after {after:.4f} s, whether lost or not captured"
    return (
        f"{each.channel} #{each.number}, of {ip_address(address)} port {port}, as a whole: {why}. "
        f"Behind that {messages:,} messages were judged one by one, and {others:,} bytes not read"
    )


def _nothing_found(reader: _Reader, ipc_port: int, message_port: int) -> str:
    text = f"{reader.path}: no connection to TCP port {ipc_port} (IPC) or {message_port}"
    text += " (messages) in it"
    if reader.accepting:
        most = [str(port) for port, _ in reader.accepting.most_common(MOST_PORTS)]
        more = ", and others" if len(reader.accepting) > MOST_PORTS else ""
        return f"{text}; it has TCP ports {', '.join(most)}{more}: name yours with --ports IPC,MSG"
    if reader.strange:
        kinds = ", ".join(map(str, sorted(reader.strange)))
        return f"{text}; links of type {kinds} are not read, those of `tcpdump -i any` are"
    return f"{text}, and no TCP at all: capture where client or server runs, `tcpdump -i any`"


def _time(entry: Entry) -> float:
    return entry.t
