"""What a server did with the device memory that it shows, told from its calls.

Pure functions from init packets and calls (spec 1.0 sections 5.4 and 5.5, 1.1 chapter 5).
"""

import base64
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.images.memory.cuda_stand_in.device import Named, named_by
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.wire.json_values import is_handle, whole, within
from splatbus_conformance.wire.messages import Json

MAX_SLOTS: int = LIMITS["max_slots"]
DEFAULT_STREAM = 0
NON_BLOCKING = 1
FREES = ("cudaFree", "cudaEventDestroy")
RESET = "cudaDeviceReset"
OFFSETS = {"colour": ("mem_color", "offsetColor", 16), "depth": ("mem_depth", "offsetDepth", 4)}
RING = {"colour": ("color", 16), "depth": ("depth", 4)}


class PlaneSpan(NamedTuple):
    """Where a plane of an image lies, in bytes of an allocation."""

    memory: str
    begin: int
    end: int


def named(handle: object) -> Named | None:
    """What a handle in an init packet names; None if it is none of the stand-in."""
    return named_by(base64.b64decode(handle)) if is_handle(handle) else None  # type: ignore[arg-type]


def legacy_planes(packet: Json) -> dict[str, PlaneSpan]:
    """Colour and depth as the members of 1.0 name them; those that cannot be told are left out."""
    places = {}
    for what, (handle, offset, size) in OFFSETS.items():
        at = within(packet, "meta", offset)
        places[what] = (packet.get(handle), 0 if at is None else at, size)
    return _spans(packet, places)


def slot_planes(packet: Json, slot: int) -> dict[str, PlaneSpan]:
    """Colour and depth of a slot of the ring; those that cannot be told are left out."""
    handle, places = within(packet, "memory", "handle"), {}
    for what, (name, size) in RING.items():
        begin = whole(within(packet, "ring", f"{name}Offset"), 0)
        stride = whole(within(packet, "ring", f"{name}Stride"), 0)
        at = None if begin is None or stride is None else begin + slot * stride
        places[what] = (handle, at, size)
    return _spans(packet, places)


def planes_of(packet: Json) -> list[PlaneSpan]:
    """Every plane that an init packet announces."""
    slots = whole(within(packet, "ring", "slots"), 0, MAX_SLOTS) or 0
    rings = [span for slot in range(slots) for span in slot_planes(packet, slot).values()]
    return [*legacy_planes(packet).values(), *rings]


def _spans(packet: Json, places: Mapping[str, tuple[Any, Any, int]]) -> dict[str, PlaneSpan]:
    width, height = (whole(within(packet, "meta", name), 1) for name in "wh")
    found = {}
    for what, (handle, offset, size) in places.items():
        of, begin = named(handle), whole(offset, 0)
        if of and of.kind == "memory" and begin is not None and width and height:
            found[what] = PlaneSpan(of.name, begin, begin + size * width * height)
    return found


# What is written


def is_write(call: Call) -> bool:
    """It copied or set something in device memory."""
    return bool(call.to) and call.width > 0 and call.ok


def writes(call: Call, span: PlaneSpan) -> bool:
    """It wrote into a plane."""
    end = call.to_offset + max(1, call.height) * call.width
    into = is_write(call) and call.to == span.memory
    return into and call.to_offset < span.end and span.begin < end


def reads(call: Call, span: PlaneSpan) -> bool:
    """It copied something out of a plane."""
    end = call.offset + (max(1, call.height) - 1) * call.pitch + call.width
    return call.memory == span.memory and call.offset < span.end and span.begin < end


def beside(calls: Iterable[Call], planes: Iterable[PlaneSpan]) -> Iterator[Call]:
    """Copies into and out of memory that is shown, but of no image in it (CUD-1)."""
    shown = list(planes)
    memories = {span.memory for span in shown}
    for call in filter(lambda call: call.ok and call.width, calls):
        into = call.to in memories and not any(writes(call, span) for span in shown)
        out = call.memory in memories and not any(reads(call, span) for span in shown)
        if into or out:
            yield call


def freed(calls: Iterable[Call], names: Iterable[str], process: int) -> Call | None:
    """The first call that freed memory or an event of these names, or all of the process's."""
    wanted = set(names)
    for call in calls:
        of_these = call.function in FREES and call.ok and {call.memory, call.event} & wanted
        if of_these or (call.function == RESET and call.process == process):
            return call
    return None


# What is recorded


class Moment(NamedTuple):
    """How things are after a write to an image, or a record of its event."""

    call: Call
    written: frozenset[str]
    """The planes that were written until now."""
    open: frozenset[str]
    """Those of them whose last write no record of the event comes after."""

    @property
    def recorded(self) -> bool:
        """It is the event's record."""
        return self.call.function == "cudaEventRecord"


class _Written(NamedTuple):
    """A write that no later one has covered."""

    begin: int
    end: int
    stream: int
    number: int


Clock = dict[int, int]
"""For each stream the number of its last write that something comes after."""


@dataclass
class _Streams:
    """Which writes are ordered before what: by stream, by events, by the host's waits."""

    after: dict[int, Clock] = field(default_factory=dict)
    host: Clock = field(default_factory=dict)
    carried: dict[str, Clock] = field(default_factory=dict)
    non_blocking: set[int] = field(default_factory=set)

    def now(self, stream: int) -> Clock:
        """What comes before a thing that is put on this stream now."""
        parts = [self.host, self.after.get(stream, {})]
        if stream == DEFAULT_STREAM:
            parts += [c for number, c in self.after.items() if number not in self.non_blocking]
        elif stream not in self.non_blocking:
            parts.append(self.after.get(DEFAULT_STREAM, {}))
        return _latest(*parts)

    def follow(self, call: Call, number: int) -> None:
        """Take a call that succeeded into account, the one of this number."""
        match call.function:
            case "cudaStreamCreate" if call.flags == NON_BLOCKING:
                self.non_blocking.add(call.stream)
            case "cudaEventRecord":
                self.carried[call.event] = self.now(call.stream)
            case "cudaStreamWaitEvent":
                known = self.carried.get(call.event, {})
                self.after[call.stream] = _latest(self.now(call.stream), known)
            case "cudaStreamSynchronize" | "cudaStreamQuery":
                self.host = _latest(self.host, self.now(call.stream))
            case "cudaEventSynchronize" | "cudaEventQuery":
                self.host = _latest(self.host, self.carried.get(call.event, {}))
            case "cudaDeviceSynchronize":
                self.host = _latest(self.host, *self.after.values())
        if is_write(call):
            self.after[call.stream] = self.now(call.stream) | {call.stream: number}
            if call.function in ("cudaMemcpy", "cudaMemcpy2D"):
                self.host = _latest(self.host, self.after[call.stream])


def _latest(*clocks: Clock) -> Clock:
    found: Clock = {}
    for stream, number in (pair for clock in clocks for pair in clock.items()):
        found[stream] = max(number, found.get(stream, number))
    return found


def moments(calls: Iterable[Call], event: str, planes: Mapping[str, PlaneSpan]) -> list[Moment]:
    """What became of an image: every write to its planes, every record of its event.

    A record counts on any stream that comes after the write, as CUDA orders streams, events and
    the host's own waits.
    """
    streams = _Streams()
    last: dict[str, list[_Written]] = {}
    found = []
    for number, call in enumerate(call for call in calls if call.ok):
        streams.follow(call, number)
        written = [what for what, span in planes.items() if writes(call, span)]
        for what in written:
            begin = max(planes[what].begin, call.to_offset)
            end = min(planes[what].end, call.to_offset + max(1, call.height) * call.width)
            left = [it for it in last.get(what, []) if it.begin < begin or end < it.end]
            last[what] = [*left, _Written(begin, end, call.stream, number)]
        if written or (call.function == "cudaEventRecord" and call.event == event):
            behind = streams.carried.get(event, {})
            still_open = (
                what
                for what, seen in last.items()
                if any(behind.get(write.stream, -1) < write.number for write in seen)
            )
            found.append(Moment(call, frozenset(last), frozenset(still_open)))
    return found


def share_left_open(found: list[Moment], planes: Mapping[str, PlaneSpan]) -> float:
    """The share of the time in which the whole image lay there without its event behind it."""
    total = found[-1].call.time - found[0].call.time if found else 0.0
    left = (
        later.call.time - earlier.call.time
        for earlier, later in pairwise(found)
        if earlier.open == planes.keys()
    )
    return sum(left) / total if total else 0.0
