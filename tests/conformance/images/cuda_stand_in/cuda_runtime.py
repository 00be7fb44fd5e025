"""The CUDA runtime through ctypes, and what it answers to calls that are wrong.

`python cuda_runtime.py LIBRARY` prints the answers of a runtime as JSON. What a real one answered
is kept in tests/data/cuda_runtime_answers.json; the stand-in is compared with that.
"""

import ctypes
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

Answers = Iterator[tuple[str, Any]]
Group = Callable[[Any, str], Answers]
START = (sys.executable, __file__)
H2H, H2D, D2H, D2D, DEFAULT = range(5)
DISABLE_TIMING, INTERPROCESS = 2, 4
LAZY_PEER_ACCESS = 1
SIZE = 4096  # of most allocations


class Handle(ctypes.Structure):
    """A `cudaIpcMemHandle_t` or `cudaIpcEventHandle_t`."""

    _fields_ = [("reserved", ctypes.c_ubyte * 64)]


TYPES = {
    "p": ctypes.c_void_p, "z": ctypes.c_size_t, "i": ctypes.c_int, "u": ctypes.c_uint, "h": Handle
}  # fmt: skip
SIGNATURES = {
    "GetDeviceCount": "p", "SetDevice": "i", "GetDevice": "p", "DeviceGetAttribute": "pii",
    "DeviceGetPCIBusId": "pii", "RuntimeGetVersion": "p", "DriverGetVersion": "p",
    "DeviceSynchronize": "", "DeviceReset": "", "GetLastError": "", "PeekAtLastError": "",
    "Malloc": "pz", "Free": "p", "MallocHost": "pz", "FreeHost": "p",
    "Memset": "piz", "MemsetAsync": "pizp", "Memcpy": "ppzi", "MemcpyAsync": "ppzip",
    "Memcpy2D": "pzpzzzi", "Memcpy2DAsync": "pzpzzzip",
    "IpcGetMemHandle": "pp", "IpcOpenMemHandle": "phu", "IpcCloseMemHandle": "p",
    "IpcGetEventHandle": "pp", "IpcOpenEventHandle": "ph",
    "EventCreate": "p", "EventCreateWithFlags": "pu", "EventRecord": "pp", "EventQuery": "p",
    "EventSynchronize": "p", "EventDestroy": "p", "EventElapsedTime": "ppp",
    "StreamCreate": "p", "StreamCreateWithFlags": "pu", "StreamDestroy": "p",
    "StreamSynchronize": "p", "StreamQuery": "p", "StreamWaitEvent": "ppu",
}  # fmt: skip


class Cuda:
    """`Cuda(path).Malloc(…)` calls `cudaMalloc`; the answer is the error code."""

    def __init__(self, path: str) -> None:
        library = ctypes.CDLL(path)
        for name, signature in SIGNATURES.items():
            function = getattr(library, f"cuda{name}")
            function.argtypes = [TYPES[letter] for letter in signature]
            setattr(self, name, function)
        for name in ("GetErrorName", "GetErrorString"):
            function = getattr(library, f"cuda{name}")
            function.restype = ctypes.c_char_p
            setattr(self, name, function)

    def made(self, name: str, *arguments: Any) -> int:
        """What a call of this name creates: a pointer, a stream or an event."""
        value = ctypes.c_void_p()
        if code := getattr(self, name)(ctypes.byref(value), *arguments):
            raise RuntimeError(f"cuda{name} gave {code}")
        return value.value or 0

    def handle(self, name: str, of: int) -> Handle:
        """The interprocess handle of a pointer or an event."""
        value = Handle()
        if code := getattr(self, name)(ctypes.byref(value), of):
            raise RuntimeError(f"cuda{name} gave {code}")
        return value

    def interprocess_event(self) -> int:
        return self.made("EventCreateWithFlags", INTERPROCESS | DISABLE_TIMING)


def as_handle(text: str) -> Handle:
    return Handle.from_buffer_copy(bytes.fromhex(text))


def as_text(handle: Handle) -> str:
    return bytes(handle).hex()


class Neighbour:
    """Another process with the same library: `neighbour("expression over cuda")` evaluates it."""

    def __init__(self, path: str, start: Sequence[str] = START) -> None:
        command = [*start, path, "--neighbour"]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def __call__(self, line: str) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(line, file=self.process.stdin, flush=True)
        return json.loads(self.process.stdout.readline())

    def leave(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(60)


def serve_neighbour(**known: Any) -> None:
    host = (ctypes.c_ubyte * (64 << 10))()
    known = {**globals(), "out": ctypes.c_void_p(), "host": host, **known}
    for line in sys.stdin:
        try:
            value = eval(line, known)
        except Exception as error:
            value = repr(error)
        print(json.dumps(value), flush=True)


def devices(cuda: Any, _path: str) -> Answers:
    number, text = ctypes.c_int(), ctypes.create_string_buffer(64)
    yield "count", cuda.GetDeviceCount(ctypes.byref(number))
    yield "count into nothing", cuda.GetDeviceCount(None)
    yield "device -1", cuda.SetDevice(-1)
    yield "device 99", cuda.SetDevice(99)
    yield "the error stays until asked for", [cuda.PeekAtLastError(), cuda.GetLastError()]
    yield "and is asked for once", cuda.GetLastError()
    yield "device 0", cuda.SetDevice(0)
    yield "which device", [cuda.GetDevice(ctypes.byref(number)), number.value]
    yield "which device into nothing", cuda.GetDevice(None)
    yield "unified addressing", [cuda.DeviceGetAttribute(ctypes.byref(number), 41, 0), number.value]
    yield "attribute 99999", cuda.DeviceGetAttribute(ctypes.byref(number), 99999, 0)
    yield "attribute of device 99", cuda.DeviceGetAttribute(ctypes.byref(number), 41, 99)
    yield "bus id", [cuda.DeviceGetPCIBusId(text, 64, 0), len(text.value)]
    yield "bus id in one byte", cuda.DeviceGetPCIBusId(text, 1, 0)
    yield "bus id of device 99", cuda.DeviceGetPCIBusId(text, 64, 99)
    yield "version into nothing", [cuda.RuntimeGetVersion(None), cuda.DriverGetVersion(None)]
    yield "synchronise", cuda.DeviceSynchronize()


def allocations(cuda: Any, _path: str) -> Answers:
    pointer = ctypes.c_void_p(5)
    yield "nothing", [cuda.Malloc(ctypes.byref(pointer), 0), pointer.value]
    yield "a pebibyte", cuda.Malloc(ctypes.byref(pointer), 1 << 50)
    yield "into nothing", cuda.Malloc(None, SIZE)
    yield "free nothing", cuda.Free(None)
    yield "free what was never allocated", cuda.Free(0x1230)
    memory = cuda.made("Malloc", SIZE)
    yield "aligned to 256", memory % 256
    yield "free the middle", cuda.Free(memory + 16)
    yield "free", cuda.Free(memory)
    yield "free twice", cuda.Free(memory)
    host = ctypes.create_string_buffer(SIZE)
    yield "free memory of the host", cuda.Free(ctypes.addressof(host))
    pinned = cuda.made("MallocHost", SIZE)
    yield "free pinned memory as the device's", cuda.Free(pinned)
    yield "free pinned memory", cuda.FreeHost(pinned)
    yield "free pinned memory twice", cuda.FreeHost(pinned)
    yield "free no pinned memory", cuda.FreeHost(None)
    yield "pin nothing", cuda.MallocHost(ctypes.byref(pointer), 0)


def copies(cuda: Any, _path: str) -> Answers:
    memory = cuda.made("Malloc", SIZE)
    host = (ctypes.c_ubyte * (2 * SIZE))()
    yield "set", cuda.Memset(memory, 7, SIZE)
    yield "set too much", cuda.Memset(memory, 7, 1 << 30)
    yield "set the host", cuda.Memset(ctypes.addressof(host), 7, SIZE)
    yield "set nothing", cuda.Memset(memory, 7, 0)
    yield "down", [cuda.Memcpy(host, memory, SIZE, D2H), host[0], host[SIZE - 1], host[SIZE]]
    yield "up", cuda.Memcpy(memory, host, SIZE, H2D)
    yield "within", cuda.Memcpy(memory, memory + SIZE // 2, SIZE // 2, D2D)
    yield "any direction", cuda.Memcpy(host, memory, SIZE, DEFAULT)
    yield "direction 7", cuda.Memcpy(host, memory, SIZE, 7)
    yield "direction -1", cuda.Memcpy(host, memory, SIZE, -1)
    yield "nothing", cuda.Memcpy(host, memory, 0, D2H)
    yield "to nowhere", cuda.Memcpy(None, memory, SIZE, D2H)
    yield "from nowhere", cuda.Memcpy(memory, None, SIZE, D2D)
    yield "down, from the host", cuda.Memcpy(host, ctypes.addressof(host) + SIZE, SIZE, D2H)
    yield "up, from the device", cuda.Memcpy(memory, memory + 2048, 64, H2D)
    yield "host to host", cuda.Memcpy(host, ctypes.addressof(host) + SIZE, SIZE, H2H)
    yield "wait", cuda.StreamSynchronize(None)
    plane = (host, 64, memory, 128, 64, 32)
    yield "rows", cuda.Memcpy2D(*plane, D2H)
    yield "rows wider than their pitch", cuda.Memcpy2D(host, 64, memory, 128, 65, 32, D2H)
    yield "rows wider than the source's pitch", cuda.Memcpy2D(host, 256, memory, 128, 129, 2, D2H)
    yield "no rows", cuda.Memcpy2D(host, 64, memory, 128, 64, 0, D2H)
    yield "no columns", cuda.Memcpy2D(host, 64, memory, 128, 0, 32, D2H)
    yield "rows in direction 7", cuda.Memcpy2D(*plane, 7)
    yield "rows from nowhere", cuda.Memcpy2D(host, 64, None, 128, 64, 32, D2H)
    yield "rows async", cuda.Memcpy2DAsync(*plane, D2H, None)
    yield "synchronise", cuda.DeviceSynchronize()
    cuda.Free(memory)
    yield "from freed memory", cuda.Memcpy(host, memory, SIZE, D2H)
    yield "to freed memory", cuda.Memcpy(memory, host, SIZE, H2D)
    yield "set freed memory", cuda.Memset(memory, 7, SIZE)
    yield "the last error", cuda.GetLastError()


def beyond(cuda: Any, _path: str) -> Answers:
    """The real runtime rounds allocations up, so these go far beyond."""
    memory, host = cuda.made("Malloc", SIZE), (ctypes.c_ubyte * (64 << 20))()
    yield "copy 64 MiB of 4 KiB", cuda.Memcpy(host, memory, 64 << 20, D2H)
    yield "copy 64 MiB of rows", cuda.Memcpy2D(host, 4096, memory, 4096, 4096, 16384, D2H)
    yield "copy before it", cuda.Memcpy(host, memory - (32 << 20), SIZE, D2H)
    yield "works on", cuda.Memcpy(host, memory, SIZE, D2H)


def streams(cuda: Any, _path: str) -> Answers:
    out = ctypes.c_void_p()
    stream = cuda.made("StreamCreate")
    yield "query", cuda.StreamQuery(stream)
    yield "query the default one", cuda.StreamQuery(None)
    yield "synchronise the default one", cuda.StreamSynchronize(None)
    yield "non-blocking", cuda.StreamCreateWithFlags(ctypes.byref(out), 1)
    yield "flag 8", cuda.StreamCreateWithFlags(ctypes.byref(out), 8)
    yield "into nothing", cuda.StreamCreate(None)
    yield "destroy the default one", cuda.StreamDestroy(None)
    yield "legacy and per-thread ones", [cuda.StreamSynchronize(1), cuda.StreamSynchronize(2)]
    yield "wait for no event", cuda.StreamWaitEvent(stream, None, 0)
    event = cuda.made("EventCreate")
    yield "wait for an event never recorded", cuda.StreamWaitEvent(stream, event, 0)
    yield "wait with flag 8", cuda.StreamWaitEvent(stream, event, 8)
    yield "destroy", cuda.StreamDestroy(stream)


def events(cuda: Any, _path: str) -> Answers:
    out, time = ctypes.c_void_p(), ctypes.c_float()
    for flags in (0, 1, 2, 4, 6, 7, 8, 256):
        yield f"flags {flags}", cuda.EventCreateWithFlags(ctypes.byref(out), flags)
    yield "into nothing", cuda.EventCreate(None)
    event, other = cuda.made("EventCreate"), cuda.made("EventCreate")
    yield "query before any record", cuda.EventQuery(event)
    yield "synchronise before any record", cuda.EventSynchronize(event)
    yield "time before any record", cuda.EventElapsedTime(ctypes.byref(time), event, other)
    yield "record", [cuda.EventRecord(event, None), cuda.EventRecord(other, None)]
    yield "synchronise", cuda.EventSynchronize(other)
    yield "query", cuda.EventQuery(other)
    yield "time", cuda.EventElapsedTime(ctypes.byref(time), event, other)
    untimed = cuda.interprocess_event()
    yield "record one without time", cuda.EventRecord(untimed, None)
    yield "time of one without", cuda.EventElapsedTime(ctypes.byref(time), untimed, other)
    none = [cuda.EventRecord(None, None), cuda.EventQuery(None), cuda.EventSynchronize(None)]
    yield "of no event: record, query, synchronise, destroy", [*none, cuda.EventDestroy(None)]
    yield "destroy", cuda.EventDestroy(event)


def pending(cuda: Any, path: str) -> Answers:
    """A real device is kept busy for a while; an event behind that is not ready."""
    big = cuda.made("Malloc", 1 << 30)
    stream = cuda.made("StreamCreateWithFlags", 1)
    event = cuda.interprocess_event()
    for _ in range(1000):
        cuda.MemsetAsync(big, 1, 1 << 30, stream)
    cuda.EventRecord(event, stream)
    yield "query", [cuda.EventQuery(event), cuda.PeekAtLastError(), cuda.GetLastError()]
    yield "stream", cuda.StreamQuery(stream)
    neighbour = Neighbour(path)
    handle = as_text(cuda.handle("IpcGetEventHandle", event))
    neighbour(f"cuda.IpcOpenEventHandle(ctypes.byref(out), as_handle('{handle}'))")
    for _ in range(10000):
        cuda.MemsetAsync(big, 1, 1 << 30, stream)
    cuda.EventRecord(event, stream)
    yield "elsewhere", neighbour("[cuda.EventQuery(out), cuda.PeekAtLastError()]")
    yield "the default stream elsewhere", neighbour("cuda.StreamWaitEvent(None, out, 0)")
    yield "which then is busy", neighbour("cuda.StreamQuery(None)")
    yield "synchronised", [cuda.EventSynchronize(event), cuda.EventQuery(event)]
    yield "elsewhere too", neighbour("[cuda.EventSynchronize(out), cuda.EventQuery(out)]")
    neighbour.leave()


def own_handles(cuda: Any, _path: str) -> Answers:
    out, handle = ctypes.c_void_p(), Handle()
    memory = cuda.made("Malloc", 4 << 20)
    yield "of memory", cuda.IpcGetMemHandle(ctypes.byref(handle), memory)
    again = cuda.handle("IpcGetMemHandle", memory)
    yield "the same again", as_text(again) == as_text(handle)
    yield "open one's own", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, LAZY_PEER_ACCESS)
    yield "with flags 0", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, 0)
    yield "with flags 2", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, 2)
    yield "into nothing", cuda.IpcOpenMemHandle(None, handle, LAZY_PEER_ACCESS)
    yield "of its middle", cuda.IpcGetMemHandle(ctypes.byref(handle), memory + 512)
    yield "that is its own", as_text(handle) == as_text(again)
    yield "of nothing", cuda.IpcGetMemHandle(ctypes.byref(handle), None)
    host = ctypes.create_string_buffer(SIZE)
    yield "of the host", cuda.IpcGetMemHandle(ctypes.byref(handle), ctypes.addressof(host))
    pinned = cuda.made("MallocHost", SIZE)
    yield "of pinned memory", cuda.IpcGetMemHandle(ctypes.byref(handle), pinned)
    yield "close what was not opened", cuda.IpcCloseMemHandle(memory)
    yield "close nothing", cuda.IpcCloseMemHandle(None)
    yield "close the host", cuda.IpcCloseMemHandle(ctypes.addressof(host))
    cuda.Free(memory)
    yield "of freed memory", cuda.IpcGetMemHandle(ctypes.byref(handle), memory)
    yield "open one's own after free", cuda.IpcOpenMemHandle(ctypes.byref(out), again, 1)
    for text in ("00" * 64, "55" * 64, b"nobody can open this".ljust(64, b".").hex()):
        code = cuda.IpcOpenMemHandle(ctypes.byref(out), as_handle(text), LAZY_PEER_ACCESS)
        yield f"open memory {text[:8]}", code
        yield f"open event {text[:8]}", cuda.IpcOpenEventHandle(ctypes.byref(out), as_handle(text))
    event, plain = cuda.interprocess_event(), cuda.made("EventCreate")
    yield "of an event", cuda.IpcGetEventHandle(ctypes.byref(handle), event)
    yield "open one's own event", cuda.IpcOpenEventHandle(ctypes.byref(out), handle)
    yield "open it into nothing", cuda.IpcOpenEventHandle(None, handle)
    yield "of a plain event", cuda.IpcGetEventHandle(ctypes.byref(handle), plain)
    yield "of no event", cuda.IpcGetEventHandle(ctypes.byref(handle), None)


def others_handles(cuda: Any, path: str) -> Answers:
    neighbour = Neighbour(path)
    host = (ctypes.c_ubyte * SIZE)()
    offered = neighbour(
        "(m := cuda.made('Malloc', 4 << 20), cuda.Memset(m, 7, 4 << 20), cuda.DeviceSynchronize(), "
        "as_text(cuda.handle('IpcGetMemHandle', m)))"
    )
    handle, one, two = as_handle(offered[-1]), ctypes.c_void_p(), ctypes.c_void_p()
    yield "with flags 0", cuda.IpcOpenMemHandle(ctypes.byref(one), handle, 0)
    yield "open", cuda.IpcOpenMemHandle(ctypes.byref(one), handle, LAZY_PEER_ACCESS)
    yield "open again", cuda.IpcOpenMemHandle(ctypes.byref(two), handle, LAZY_PEER_ACCESS)
    yield "the same pointer", one.value == two.value
    yield "read", [cuda.Memcpy(host, one, SIZE, D2H), host[0], host[SIZE - 1]]
    yield "the exporter's size", cuda.Memcpy(host, (one.value or 0) + (4 << 20) - SIZE, SIZE, D2H)
    yield "write", [cuda.Memset(one, 9, SIZE), cuda.DeviceSynchronize()]
    yield "free what was opened", cuda.Free(one)
    again = Handle()
    yield "hand it on", cuda.IpcGetMemHandle(ctypes.byref(again), one)
    yield "close its middle", cuda.IpcCloseMemHandle((one.value or 0) + 512)
    yield "close", cuda.IpcCloseMemHandle(one)
    yield "read on", cuda.Memcpy(host, one, SIZE, D2H)
    yield "close again", cuda.IpcCloseMemHandle(one)
    yield "read after the last close", cuda.Memcpy(host, one, SIZE, D2H)
    yield "close a third time", cuda.IpcCloseMemHandle(one)
    yield "open once more", cuda.IpcOpenMemHandle(ctypes.byref(one), handle, LAZY_PEER_ACCESS)
    yield "the neighbour frees it", neighbour(f"cuda.Free({offered[0]})")
    yield "open after that", cuda.IpcOpenMemHandle(ctypes.byref(two), handle, LAZY_PEER_ACCESS)
    yield "close after that", cuda.IpcCloseMemHandle(one)
    cuda.IpcCloseMemHandle(two)
    yield "open freed memory", cuda.IpcOpenMemHandle(ctypes.byref(one), handle, LAZY_PEER_ACCESS)
    event = neighbour(
        "(e := cuda.interprocess_event(), cuda.EventRecord(e, None), cuda.DeviceSynchronize(), "
        "as_text(cuda.handle('IpcGetEventHandle', e)))"
    )
    handle = as_handle(event[-1])
    yield "open event", cuda.IpcOpenEventHandle(ctypes.byref(one), handle)
    yield "open event again", cuda.IpcOpenEventHandle(ctypes.byref(two), handle)
    yield "another event", one.value != two.value
    yield "event as memory", cuda.IpcOpenMemHandle(ctypes.byref(two), handle, LAZY_PEER_ACCESS)
    uses = [cuda.EventQuery(one), cuda.EventSynchronize(one), cuda.StreamWaitEvent(None, one, 0)]
    yield "query, synchronise, wait, record", [*uses, cuda.EventRecord(one, None)]
    yield "hand the event on", cuda.IpcGetEventHandle(ctypes.byref(again), one)
    yield "destroy it", cuda.EventDestroy(one)
    yield "the neighbour destroys it", neighbour(f"cuda.EventDestroy({event[0]})")
    yield "open it then", cuda.IpcOpenEventHandle(ctypes.byref(one), handle)
    memory = as_handle(
        neighbour("as_text(cuda.handle('IpcGetMemHandle', cuda.made('Malloc', 99)))")
    )
    left = as_handle(
        neighbour("as_text(cuda.handle('IpcGetEventHandle', cuda.interprocess_event()))")
    )
    neighbour.leave()
    code = cuda.IpcOpenMemHandle(ctypes.byref(one), memory, LAZY_PEER_ACCESS)
    yield "memory of a process that has ended", code
    yield "event of a process that has ended", cuda.IpcOpenEventHandle(ctypes.byref(one), left)


def texts(cuda: Any, _path: str) -> Answers:
    for code in (0, 1, 2, 3, 12, 17, 21, 100, 101, 201, 205, 400, 600, 801, 9999):
        texts = cuda.GetErrorName(code), cuda.GetErrorString(code)
        yield str(code), [text.decode() for text in texts]


GROUPS = (
    devices, allocations, copies, beyond, streams, events, pending, own_handles, others_handles,
    texts,
)  # fmt: skip


def answers(path: str, group: str, start: Sequence[str] = START, **more: str) -> dict[str, Any]:
    """What a library answers to a group of calls, in a process of their own."""
    command, variables = [*start, path, group], {**os.environ, **more}
    ran = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=120, env=variables)
    found = dict(json.loads(line) for line in ran.stdout.splitlines())
    return found | ({"ended with": ran.returncode} if ran.returncode else {})


def tell(cuda: Any, groups: Sequence[Group], start: Sequence[str], path: str, *what: str) -> None:
    """What `path`, which is loaded as `cuda`, answers: to one group, or each in its own process."""
    if what:
        group = next(group for group in groups if group.__name__ == what[0])
        for name, answer in group(cuda, path):
            print(json.dumps([name, answer]), flush=True)
    else:
        names = [group.__name__ for group in groups]
        print(json.dumps({name: answers(path, name, start) for name in names}, indent=1))


if __name__ == "__main__":
    if sys.argv[2:] == ["--neighbour"]:
        serve_neighbour(cuda=Cuda(sys.argv[1]))
    else:
        tell(Cuda(sys.argv[1]), GROUPS, START, *sys.argv[1:])
