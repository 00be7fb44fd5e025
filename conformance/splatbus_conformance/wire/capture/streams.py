"""TCP put together again: from the segments of a connection to what its ends sent."""

import re
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import accumulate
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.capture.headers import Endpoint, Segment
from splatbus_conformance.wire.packets import HEADER
from splatbus_conformance.wire.recording import Direction, Event

HALF, ALL = 1 << 31, 1 << 32
_HEADER_AND_OBJECT = re.compile(rb"..[\x00-\x10]\x00[ \t\r\n]*\{", re.DOTALL)
"""No text of JSON has a byte of 0, so that this is no part of one."""


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
    waiting: list[tuple[int, int, int, bytes]] = field(default_factory=list)
    """What came too early: place, segment, time and bytes."""

    def place(self, seq: int) -> int:
        """Where a sequence number is, which begins again after 4 GiB."""
        if self.first is None:
            self.first = seq
        return (seq - self.first - self.next + HALF) % ALL - HALF + self.next

    def in_order(self) -> Iterable[bytes]:
        """What can be read now."""
        while self.waiting and self.waiting[0][0] <= self.next:
            place, *_, data = heappop(self.waiting)
            if new := data[self.next - place :]:
                self.next += len(new)
                yield new

    @property
    def lacks_something(self) -> bool:
        """Whether bytes were sent that were not captured."""
        sent = self.proven if self.fin is None else min(self.proven, self.fin)
        return bool(self.waiting) or sent > self.next


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
        stream, other = streams[direction], streams["s2c" if direction == "c2s" else "c2s"]
        place = stream.place((it.seq + it.syn) % ALL)
        if it.ack is not None and not it.rst:
            is_begun = is_begun or (it.syn and direction == "s2c")
            other.proven = max(other.proven, other.place(it.ack))
        stream.proven = max(stream.proven, place + it.length)
        if it.fin:
            stream.fin = place + it.length
        if it.data and not it.rst:
            heappush(stream.waiting, (place, number, it.ns, it.data))
        for data in stream.in_order():
            came.append((number, Piece(it.ns, direction, data)))
            stream.last = number
        if not stream.is_ended and (it.rst or stream.fin == stream.next):
            came.append((number, Piece(it.ns, direction, event="reset" if it.rst else "eof")))
            stream.is_ended = True
    if not (is_begun or any(stream.proven > 0 for stream in streams.values())):
        return None
    lacking = [stream.last for stream in streams.values() if stream.lacks_something]
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


def _runs(direction: Direction, late: list[Piece], stream: _Stream) -> list[Run]:
    """What came in order too late, and what lies behind gaps."""
    runs = [[each for each in late if each.data]]
    end = stream.next
    for place, _, ns, data in sorted(stream.waiting):
        if place > end:
            runs.append([])
        if new := data[max(0, end - place) :]:
            runs[-1].append(Piece(ns, direction, new))
        end = max(end, place + len(data))
    return [run for run in runs if run]


def whole_packets(run: Run) -> tuple[list[Piece], int]:
    """The packets that can be told in a run that may begin and end within one, and how many other
    bytes it has.
    """
    data = b"".join(piece.data or b"" for piece in run)
    ends = list(accumulate(len(piece.data or b"") for piece in run))
    found: list[Piece] = []
    at = others = 0
    while match := _HEADER_AND_OBJECT.search(data, at):
        begin = match.start()
        length = int.from_bytes(data[begin : begin + HEADER], "little")
        end = begin + HEADER + length
        if not 1 <= length <= LIMITS["max_payload_bytes"] or end > len(data):
            end = begin + 1
            others += end - at
        else:
            others += begin - at
            arrived = run[bisect_right(ends, end - 1)]
            found.append(arrived._replace(data=data[begin:end]))
        at = end
    return found, others + len(data) - at
