"""What a client did with the device memory of its server, told from its calls.

Pure functions from calls to the calls that break a rule of spec 1.0 section 5.4 or 5.5.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from splatbus_conformance.images.memory.cuda_stand_in.trace import Call

Spans = list[tuple[str, int, int]]
"""Bytes that were read: memory, beginning, end."""
DEFAULT_STREAM = 0
HOST = -1
"""Stands for all streams where the host itself has waited."""
NON_BLOCKING = 1
FINISHES = frozenset(
    f"cuda{name}"
    for name in ("StreamSynchronize", "StreamQuery", "DeviceSynchronize", "Memcpy", "Memcpy2D")
)
"""Calls after whose success the reads before them have finished, on their stream or all."""


def is_read(call: Call) -> bool:
    """It copied something out of device memory, its own or another process's."""
    some = call.memory and call.width and call.height
    return call.function.startswith("cudaMemcpy") and bool(some) and call.ok


@dataclass
class _Wait:
    """A wait for an event of the server, by a stream or by the host."""

    event: str
    spans: Spans = field(default_factory=list)
    """What was read since by those who come after it; a wait serves each byte once."""
    beside: Spans = field(default_factory=list)
    """What was read since by others, whom an earlier wait of the host served."""
    before: Spans = field(default_factory=list)
    """Of the host, which has waited for a stream: what had been read beside that until then."""


@dataclass
class _Process:
    """What one process has done so far."""

    opened: set[str] = field(default_factory=set)
    """Memory and events, from handles."""
    destroyed: set[str] = field(default_factory=set)
    """Events that had been opened; a wait for one serves no memory that is opened later."""
    non_blocking: set[int] = field(default_factory=set)
    waits: dict[int, _Wait] = field(default_factory=dict)
    """The last of each stream that has waited for an event of the server."""
    carried: dict[str, _Wait | None] = field(default_factory=dict)
    """For each event of the process's own: the wait that its stream had behind it."""

    def ordered(self, waited: int, reading: int) -> bool:
        """What one stream has waited for, the other comes after (CUDA's default-stream rules)."""
        if waited in (HOST, reading):
            return True
        blocking = not self.non_blocking & {waited, reading}
        return DEFAULT_STREAM in (waited, reading) and blocking


def unwaited(calls: Iterable[Call]) -> Iterator[Call]:
    """Copies whose stream has not waited for the server's event since it read the same bytes.

    A wait of the host, or of a stream that this one is ordered after, counts as well (BUF-11).
    """
    known: dict[int, _Process] = {}
    for call in calls:
        process = known.setdefault(call.process, _Process())
        if not call.ok:
            continue
        if not is_read(call):
            _follow(process, call)
        elif call.memory in process.opened and not _covered(process, call):
            yield call


def _covered(process: _Process, call: Call) -> bool:
    end = call.offset + (call.height - 1) * call.pitch + call.width
    span = call.memory, call.offset, end
    own_first = sorted(process.waits.items(), key=lambda item: item[0] == HOST)
    for stream, wait in own_first:
        read = [*wait.spans, *wait.before]
        again = any(m == call.memory and a < end and call.offset < b for m, a, b in read)
        if process.ordered(stream, call.stream) and not again:
            wait.spans.append(span)
            if stream == HOST:
                for other in process.waits.values():
                    other.beside.append(span)
            return True
    return False


def _follow(process: _Process, call: Call) -> None:
    match call.function:
        case "cudaIpcOpenMemHandle":
            process.opened.add(call.memory)
            lasting = {s: w for s, w in process.waits.items() if w.event not in process.destroyed}
            process.waits = lasting
        case "cudaIpcOpenEventHandle":
            process.opened.add(call.event)
            process.destroyed.discard(call.event)
        case "cudaEventDestroy" if call.event in process.opened:
            process.destroyed.add(call.event)
        case "cudaStreamCreate" if call.flags == NON_BLOCKING:
            process.non_blocking.add(call.stream)
        case "cudaStreamWaitEvent" if call.event in process.opened:
            process.waits[call.stream] = _Wait(call.event)
        case "cudaStreamWaitEvent" if (wait := process.carried.get(call.event)) is not None:
            process.waits[call.stream] = wait
        case "cudaEventSynchronize" | "cudaEventQuery" if call.event in process.opened:
            process.waits = {HOST: _Wait(call.event)}
        case "cudaEventRecord":
            process.carried[call.event] = process.waits.get(call.stream)
        case "cudaStreamSynchronize" if call.stream in process.waits:
            wait = process.waits[call.stream]
            process.waits[HOST] = _Wait(wait.event, wait.spans, before=list(wait.beside))


def opened_again(calls: Iterable[Call]) -> Iterator[Call]:
    """Memory that was opened while the process had it open (CUD-2)."""
    return (c for c in calls if c.function == "cudaIpcOpenMemHandle" and c.ok and c.opened > 1)


def held(calls: Iterable[Call]) -> set[tuple[int, str]]:
    """Memory and events of other processes that are still open: process and name (CUD-5)."""
    found: set[tuple[int, str]] = set()
    for call in calls:
        if not call.ok:
            continue
        match call.function:
            case "cudaIpcOpenMemHandle" | "cudaIpcOpenEventHandle":
                found.add((call.process, call.memory or call.event))
            case "cudaIpcCloseMemHandle" if call.opened == 0:
                found.discard((call.process, call.memory))
            case "cudaEventDestroy":
                found.discard((call.process, call.event))
            case "cudaDeviceReset" | "cudaExit":
                found = {each for each in found if each[0] != call.process}
    return found


def closed_while_reading(calls: Iterable[Call]) -> Iterator[Call]:
    """Memory that was closed before the host had seen its copies out of it finish (CUD-5)."""
    for call, copies in _with_copies_under_way(calls):
        under_way = any(copy.memory == call.memory for copy in copies)
        if call.function == "cudaIpcCloseMemHandle" and under_way:
            yield call


def under_way(calls: Iterable[Call], memory: str) -> list[Call]:
    """Copies out of this memory that the host has not seen finish after all calls (IMG-13)."""
    last: dict[int, list[Call]] = {}
    for call, copies in _with_copies_under_way(calls):
        last[call.process] = [copy for copy in copies if copy.memory == memory]
    return [copy for copies in last.values() for copy in copies]


def _with_copies_under_way(calls: Iterable[Call]) -> Iterator[tuple[Call, list[Call]]]:
    """Each call, and the copies of its process that then are not known to have finished."""
    known: dict[int, list[Call]] = {}
    foreign: set[tuple[int, str]] = set()
    for call in filter(lambda call: call.ok, calls):
        copies = known.setdefault(call.process, [])
        if call.function == "cudaIpcOpenEventHandle":
            foreign.add((call.process, call.event))
        own_event = (call.process, call.event) not in foreign
        if is_read(call) and call.function.endswith("Async"):
            copies.append(call)
        elif call.function in FINISHES or (
            call.function in ("cudaEventSynchronize", "cudaEventQuery") and own_event
        ):
            copies.clear()
        yield call, copies
