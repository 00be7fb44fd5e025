"""TCP put together again: from the segments of a connection to what its ends sent."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import NamedTuple

from splatbus_conformance.wire.capture.segments import Endpoint, Segment
from splatbus_conformance.wire.recording import Direction, Event

HALF, ALL = 1 << 31, 1 << 32
OTHER: dict[Direction, Direction] = {"c2s": "s2c", "s2c": "c2s"}


class Piece(NamedTuple):
    """What arrived at once in one direction: bytes, or an end."""

    ns: int
    direction: Direction
    data: bytes | None = None
    event: Event | None = None


Run = list[Piece]
"""Bytes of one direction without a gap."""


class Followed(NamedTuple):
    """A connection, as far as it was captured."""

    client: Endpoint
    server: Endpoint
    opened: int
    is_begun: bool
    """Its beginning was captured."""
    pieces: list[Piece]
    """All that either side sent before anything is missing."""
    lost: int | None
    """When something began to be missing, if anything is."""
    runs: list[Run]
    """What was captured behind that."""


@dataclass
class _Stream:
    """One direction; places in it are counted from its first byte."""

    first: int | None = None
    """The sequence number of that byte."""
    next: int = 0
    """Where the next byte in order belongs."""
    proven: int = 0
    """So many bytes were sent, captured or not."""
    fin: int | None = None
    last: int = 0
    """The segment with which bytes in order came last."""
    is_ended: bool = False
    waiting: list[tuple[int, int, int, int, bytes]] = field(default_factory=list)
    """What came too early: its place, its segment, how much of the other direction its sender had
    by then, its time, its bytes."""

    def place(self, seq: int) -> int:
        """Where a sequence number is, which begins again after 4 GiB."""
        if self.first is None:
            self.first = seq
        return (seq - self.first - self.next + HALF) % ALL - HALF + self.next

    def in_order(self, other: "_Stream") -> Iterator[bytes]:
        """What can be read now: no answer before its question, whichever was captured first."""
        heard = math.inf if other.next == other.fin else other.next
        while self.waiting and self.waiting[0][0] <= self.next and self.waiting[0][2] <= heard:
            place, *_, data = heappop(self.waiting)
            if new := data[self.next - place :]:
                self.next += len(new)
                yield new

    @property
    def has_a_gap(self) -> bool:
        """Whether what comes next was sent and not captured."""
        if self.waiting:
            return self.waiting[0][0] > self.next
        return self.next < (self.proven if self.fin is None else min(self.proven, self.fin))


def parted(segments: Iterable[Segment]) -> list[list[Segment]]:
    """Segments by connection; one between the same ends begins with a SYN of another number."""
    found: list[list[Segment]] = []
    newest: dict[frozenset[Endpoint], list[Segment]] = {}
    begun: dict[frozenset[Endpoint], int] = {}
    for each in segments:
        ends = frozenset((each.source, each.target))
        opens = each.syn and each.ack is None
        if ends not in newest or (opens and begun.get(ends) != each.seq):
            newest[ends] = []
            found.append(newest[ends])
        if opens:
            begun[ends] = each.seq
        newest[ends].append(each)
    return found


def followed(segments: Sequence[Segment], server: Endpoint) -> Followed | None:
    """What the ends of a connection sent; None if there was none, as where it was refused."""
    streams: dict[Direction, _Stream] = {"c2s": _Stream(), "s2c": _Stream()}
    came: list[tuple[int, Piece]] = []
    is_begun = False
    for number, it in enumerate(segments):
        direction: Direction = "c2s" if it.target == server else "s2c"
        stream, other = streams[direction], streams[OTHER[direction]]
        place = stream.place((it.seq + it.syn) % ALL)
        heard = 0
        if it.ack is not None and not it.rst:
            is_begun = is_begun or (it.syn and direction == "s2c")
            heard = other.place(it.ack)
            other.proven = max(other.proven, heard)
        stream.proven = max(stream.proven, place + it.length)
        if it.fin:
            stream.fin = place + it.length
        if it.data and not it.rst:
            heappush(stream.waiting, (place, number, heard, it.ns, it.data))
        came += ((number, each) for each in _read(streams, number, it.ns))
        if it.rst and not stream.is_ended:
            came.append((number, Piece(it.ns, direction, event="reset")))
            stream.is_ended = True
    if not (is_begun or any(stream.proven > 0 for stream in streams.values())):
        return None
    lacking = [stream.last for stream in streams.values() if stream.has_a_gap]
    lacking = lacking or [stream.last for stream in streams.values() if stream.waiting]
    # What answers something that is missing may have come at once behind what is not.
    until = min(lacking, default=len(segments)) if is_begun else -1
    client = next(it.source if it.target == server else it.target for it in segments)
    return Followed(
        client,
        server,
        segments[0].ns,
        is_begun,
        [piece for number, piece in came if number <= until],
        segments[max(0, until)].ns if until < len(segments) else None,
        [
            run
            for direction, stream in streams.items()
            for run in _runs(
                direction,
                [each for number, each in came if number > until and each.direction == direction],
                stream,
            )
        ],
    )


def _read(streams: dict[Direction, _Stream], number: int, ns: int) -> Iterator[Piece]:
    """What has arrived with a segment: what it was that lacked, in either direction."""
    before = -1
    while before != (before := sum(stream.next for stream in streams.values())):
        for direction, other in OTHER.items():
            stream = streams[direction]
            for data in stream.in_order(streams[other]):
                yield Piece(ns, direction, data)
                stream.last = number
            if stream.fin == stream.next and not stream.is_ended:
                yield Piece(ns, direction, event="eof")
                stream.is_ended = True


def _runs(direction: Direction, late: list[Piece], stream: _Stream) -> list[Run]:
    """What came in order too late, and what lies behind gaps."""
    runs = [[each for each in late if each.data]]
    end = stream.next
    for place, _, _, ns, data in sorted(stream.waiting):
        if place > end:
            runs.append([])
        if new := data[max(0, end - place) :]:
            runs[-1].append(Piece(ns, direction, new))
        end = max(end, place + len(data))
    return [run for run in runs if run]
