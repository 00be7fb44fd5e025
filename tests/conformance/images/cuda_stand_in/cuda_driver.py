"""The CUDA driver through ctypes, and what it answers to calls that are wrong.

`python -m tests.conformance.images.cuda_stand_in.cuda_driver LIBRARY` prints a driver's answers as
JSON. What a real one answered is kept in tests/data/cuda_driver_answers.json; the stand-in is
compared with that.
"""

import ctypes
import sys
from typing import Any

from tests.conformance.images.cuda_stand_in.cuda_runtime import (
    DISABLE_TIMING,
    INTERPROCESS,
    LAZY_PEER_ACCESS,
    SIZE,
    TYPES,
    Answers,
    Handle,
    Neighbour,
    as_handle,
    serve_neighbour,
    tell,
)

START = (sys.executable, "-m", "tests.conformance.images.cuda_stand_in.cuda_driver")
SIGNATURES = {
    "Init": "u", "DriverGetVersion": "p", "GetErrorName": "ip", "GetErrorString": "ip",
    "DeviceGetCount": "p", "DeviceGet": "pi", "DeviceGetName": "pii", "DeviceGetUuid_v2": "pi",
    "DeviceGetAttribute": "pii", "DevicePrimaryCtxRetain": "pi", "DevicePrimaryCtxRelease_v2": "i",
    "CtxPushCurrent_v2": "p", "CtxPopCurrent_v2": "p", "CtxSetCurrent": "p", "CtxGetCurrent": "p",
    "CtxGetDevice": "p", "CtxSynchronize": "",
    "MemAlloc_v2": "pz", "MemFree_v2": "p", "MemHostAlloc": "pzu", "MemAllocHost_v2": "pz",
    "MemFreeHost": "p", "MemGetAddressRange_v2": "ppp", "MemsetD8_v2": "pbz",
    "Memcpy": "ppz", "MemcpyDtoH_v2": "ppz", "MemcpyHtoD_v2": "ppz", "MemcpyDtoD_v2": "ppz",
    "MemcpyDtoHAsync_v2": "ppzp", "Memcpy2D_v2": "p", "Memcpy2DAsync_v2": "pp",
    "StreamCreate": "pu", "StreamSynchronize": "p", "StreamQuery": "p", "StreamDestroy_v2": "p",
    "StreamWaitEvent": "ppu", "EventCreate": "pu", "EventRecord": "pp", "EventQuery": "p",
    "EventSynchronize": "p", "EventDestroy_v2": "p", "EventElapsedTime": "ppp",
    "IpcGetMemHandle": "pp", "IpcOpenMemHandle_v2": "phu", "IpcCloseMemHandle": "p",
    "IpcGetEventHandle": "pp", "IpcOpenEventHandle": "ph", "GetProcAddress_v2": "ppilp",
}  # fmt: skip
LETTERS = {**TYPES, "b": ctypes.c_ubyte, "l": ctypes.c_uint64}


class End(ctypes.Structure):
    """Half of a `CUDA_MEMCPY2D`."""

    _fields_ = [
        ("x", ctypes.c_size_t),
        ("y", ctypes.c_size_t),
        ("type", ctypes.c_int),
        ("host", ctypes.c_void_p),
        ("device", ctypes.c_void_p),
        ("array", ctypes.c_void_p),
        ("pitch", ctypes.c_size_t),
    ]


class Rows(ctypes.Structure):
    """A `CUDA_MEMCPY2D`."""

    _fields_ = [
        ("source", End),
        ("target", End),
        ("width", ctypes.c_size_t),
        ("height", ctypes.c_size_t),
    ]


class Driver:
    """`Driver(path).MemAlloc(…)` calls `cuMemAlloc_v2`; the answer is the error code."""

    def __init__(self, path: str) -> None:
        library = ctypes.CDLL(path)
        for name, signature in SIGNATURES.items():
            function = getattr(library, f"cu{name}")
            function.argtypes = [LETTERS[letter] for letter in signature]
            setattr(self, name.removesuffix("_v2"), function)

    def made(self, name: str, *arguments: Any) -> int:
        """What a call of this name creates."""
        value = ctypes.c_void_p()
        if code := getattr(self, name)(ctypes.byref(value), *arguments):
            raise RuntimeError(f"cu{name} gave {code}")
        return value.value or 0

    def handle(self, name: str, of: int) -> Handle:
        """The interprocess handle of a pointer or an event."""
        value = Handle()
        if code := getattr(self, name)(ctypes.byref(value), of):
            raise RuntimeError(f"cu{name} gave {code}")
        return value

    def interprocess_event(self) -> int:
        return self.made("EventCreate", INTERPROCESS | DISABLE_TIMING)

    def begun(self) -> "Driver":
        """Itself, with the primary context of device 0 current."""
        self.Init(0)
        self.CtxPushCurrent(self.made("DevicePrimaryCtxRetain", 0))
        return self


def beginning(cuda: Any, _path: str) -> Answers:
    """Before `cuInit`, and before any context."""
    out, number = ctypes.c_void_p(), ctypes.c_int()
    text = ctypes.create_string_buffer(64)
    yield "version", [cuda.DriverGetVersion(ctypes.byref(number)), number.value > 11000]
    yield "version into nothing", cuda.DriverGetVersion(None)
    yield "count too early", cuda.DeviceGetCount(ctypes.byref(number))
    yield "device too early", cuda.DeviceGet(ctypes.byref(number), 0)
    yield "retain too early", cuda.DevicePrimaryCtxRetain(ctypes.byref(out), 0)
    yield "allocate too early", cuda.MemAlloc(ctypes.byref(out), SIZE)
    yield "flags 1", cuda.Init(1)
    yield "begin", [cuda.Init(0), cuda.Init(0)]
    yield "count into nothing", cuda.DeviceGetCount(None)
    yield "device 0", [cuda.DeviceGet(ctypes.byref(number), 0), number.value]
    yield "devices -1 and 99", [cuda.DeviceGet(ctypes.byref(number), it) for it in (-1, 99)]
    yield "name", [cuda.DeviceGetName(text, 64, 0), len(text.value) > 3]
    yield "name of device 99", cuda.DeviceGetName(text, 64, 99)
    yield "uuid of device 99", cuda.DeviceGetUuid(text, 99)
    yield "uuid", [cuda.DeviceGetUuid(text, 0), len(text.raw)]
    yield "unified addressing", [cuda.DeviceGetAttribute(ctypes.byref(number), 41, 0), number.value]
    yield "attribute of device 99", cuda.DeviceGetAttribute(ctypes.byref(number), 41, 99)
    yield "current", [cuda.CtxGetCurrent(ctypes.byref(out)), out.value]
    yield "device without a context", cuda.CtxGetDevice(ctypes.byref(number))
    without = {
        "allocate": cuda.MemAlloc(ctypes.byref(out), SIZE),
        "pin": cuda.MemAllocHost(ctypes.byref(out), SIZE),
        "stream": cuda.StreamCreate(ctypes.byref(out), 0),
        "event": cuda.EventCreate(ctypes.byref(out), 2),
        "open memory": cuda.IpcOpenMemHandle(ctypes.byref(out), Handle(), 1),
        "open event": cuda.IpcOpenEventHandle(ctypes.byref(out), Handle()),
        "synchronise": cuda.CtxSynchronize(),
        "synchronise the default stream": cuda.StreamSynchronize(None),
    }
    for name, code in without.items():
        yield f"{name} without a context", code


def contexts(cuda: Any, _path: str) -> Answers:
    cuda.Init(0)
    out, number = ctypes.c_void_p(), ctypes.c_int()
    yield "release what nobody retained", cuda.DevicePrimaryCtxRelease(0)
    yield "retain of device 99", cuda.DevicePrimaryCtxRetain(ctypes.byref(out), 99)
    yield "release of device 99", cuda.DevicePrimaryCtxRelease(99)
    context = cuda.made("DevicePrimaryCtxRetain", 0)
    yield "again the same", cuda.made("DevicePrimaryCtxRetain", 0) == context
    yield "pop nothing", cuda.CtxPopCurrent(ctypes.byref(out))
    yield "push nothing", cuda.CtxPushCurrent(None)
    yield "push", cuda.CtxPushCurrent(context)
    yield "current", [cuda.CtxGetCurrent(ctypes.byref(out)), out.value == context]
    yield "its device", [cuda.CtxGetDevice(ctypes.byref(number)), number.value]
    yield "pop", [cuda.CtxPopCurrent(ctypes.byref(out)), out.value == context]
    yield "set", cuda.CtxSetCurrent(context)
    yield "set nothing", cuda.CtxSetCurrent(None)
    yield "none left", [cuda.CtxGetCurrent(ctypes.byref(out)), out.value]
    yield "push once more", cuda.CtxPushCurrent(context)
    memory, event = cuda.made("MemAlloc", SIZE), cuda.made("EventCreate", 2)
    stream, pinned = cuda.made("StreamCreate", 1), cuda.made("MemAllocHost", SIZE)
    cuda.CtxPopCurrent(None)
    host = ctypes.create_string_buffer(SIZE)
    yield "with none current: copy down", cuda.MemcpyDtoH(host, memory, SIZE)
    yield "copy on a stream", cuda.MemcpyDtoHAsync(host, memory, SIZE, stream)
    yield "its range", cuda.MemGetAddressRange(ctypes.byref(out), None, memory)
    yield "its handle", cuda.IpcGetMemHandle(ctypes.byref(Handle()), memory)
    yield "close it", cuda.IpcCloseMemHandle(memory)
    yield "free", cuda.MemFree(memory)
    yield "free pinned memory", cuda.MemFreeHost(pinned)
    yield "query an event", cuda.EventQuery(event)
    yield "synchronise an event", cuda.EventSynchronize(event)
    yield "record an event", cuda.EventRecord(event, stream)
    yield "wait for an event", cuda.StreamWaitEvent(stream, event, 0)
    yield "synchronise a stream", cuda.StreamSynchronize(stream)
    yield "destroy an event", cuda.EventDestroy(event)
    yield "destroy a stream", cuda.StreamDestroy(stream)
    yield "release", [cuda.DevicePrimaryCtxRelease(0), cuda.DevicePrimaryCtxRelease(0)]
    yield "once too often", cuda.DevicePrimaryCtxRelease(0)


def memory(cuda: Any, _path: str) -> Answers:
    cuda.begun()
    out, size, host = ctypes.c_void_p(), ctypes.c_size_t(), (ctypes.c_ubyte * (2 * SIZE))()
    yield "nothing", cuda.MemAlloc(ctypes.byref(out), 0)
    yield "into nothing", cuda.MemAlloc(None, SIZE)
    yield "a pebibyte", cuda.MemAlloc(ctypes.byref(out), 1 << 50)
    yield "free nothing", cuda.MemFree(None)
    yield "free what was never allocated", cuda.MemFree(0x1230)
    at = cuda.made("MemAlloc", 4 << 20)
    whole = cuda.MemGetAddressRange(ctypes.byref(out), ctypes.byref(size), at + 999)
    yield "its range", [whole, out.value == at, size.value]
    yield "range without a place for it", cuda.MemGetAddressRange(None, None, at)
    yield "range of nothing", cuda.MemGetAddressRange(ctypes.byref(out), ctypes.byref(size), 0x1230)
    yield "free the middle", cuda.MemFree(at + 16)
    yield "set", cuda.MemsetD8(at, 7, SIZE)
    yield "set the host", cuda.MemsetD8(ctypes.addressof(host), 7, SIZE)
    yield "down", [cuda.MemcpyDtoH(host, at, SIZE), host[0], host[SIZE - 1], host[SIZE]]
    yield "up", cuda.MemcpyHtoD(at, host, SIZE)
    yield "within", cuda.MemcpyDtoD(at, at + 2048, 2048)
    yield "any", cuda.Memcpy(ctypes.addressof(host), at, SIZE)
    yield "down from the host", cuda.MemcpyDtoH(host, ctypes.addressof(host) + SIZE, SIZE)
    yield "to nowhere", cuda.MemcpyDtoH(None, at, SIZE)
    yield "from nowhere", cuda.MemcpyDtoH(host, None, SIZE)
    yield "nothing down", cuda.MemcpyDtoH(host, at, 0)
    yield "async", cuda.MemcpyDtoHAsync(host, at, SIZE, None)
    yield "64 MiB of 4", cuda.MemcpyDtoH((ctypes.c_ubyte * (64 << 20))(), at, 64 << 20)
    above = End(type=2, device=at, pitch=128)
    rows = Rows(above, End(type=1, host=ctypes.addressof(host), pitch=64), 64, 32)
    yield "rows", [cuda.Memcpy2D(ctypes.byref(rows)), cuda.Memcpy2DAsync(ctypes.byref(rows), None)]
    rows.width = 65
    yield "rows wider than their pitch", cuda.Memcpy2D(ctypes.byref(rows))
    rows.width, rows.source.type = 64, 9
    yield "rows of an unknown kind", cuda.Memcpy2D(ctypes.byref(rows))
    rows.source.type, rows.source.device = 2, None
    yield "rows from nowhere", cuda.Memcpy2D(ctypes.byref(rows))
    pinned = cuda.made("MemHostAlloc", SIZE, 0)
    yield "pin with flag 64", cuda.MemHostAlloc(ctypes.byref(out), SIZE, 64)
    yield "pin nothing", cuda.MemAllocHost(ctypes.byref(out), 0)
    yield "free pinned memory", cuda.MemFreeHost(pinned)
    yield "free it twice", cuda.MemFreeHost(pinned)
    yield "free no pinned memory", cuda.MemFreeHost(None)
    yield "free", cuda.MemFree(at)
    yield "free twice", cuda.MemFree(at)
    yield "from freed memory", cuda.MemcpyDtoH(host, at, SIZE)


def order(cuda: Any, _path: str) -> Answers:
    """Streams and events."""
    cuda.begun()
    out, time = ctypes.c_void_p(), ctypes.c_float()
    stream = cuda.made("StreamCreate", 1)
    yield "stream flag 8", cuda.StreamCreate(ctypes.byref(out), 8)
    yield "query", [cuda.StreamQuery(stream), cuda.StreamQuery(None)]
    yield "legacy and per-thread ones", [cuda.StreamSynchronize(1), cuda.StreamSynchronize(2)]
    yield "destroy the default one", cuda.StreamDestroy(None)
    for flags in (0, 1, 2, 4, 6, 7, 8, 256):
        yield f"event flags {flags}", cuda.EventCreate(ctypes.byref(out), flags)
    event, other = cuda.made("EventCreate", 0), cuda.made("EventCreate", 0)
    yield "never recorded", [cuda.EventQuery(event), cuda.EventSynchronize(event)]
    yield "wait for it", cuda.StreamWaitEvent(stream, event, 0)
    yield "wait with flag 8", cuda.StreamWaitEvent(stream, event, 8)
    yield "wait for no event", cuda.StreamWaitEvent(stream, None, 0)
    yield "record", [cuda.EventRecord(event, stream), cuda.EventRecord(other, stream)]
    yield "done", [cuda.EventSynchronize(other), cuda.EventQuery(other)]
    yield "time", cuda.EventElapsedTime(ctypes.byref(time), event, other)
    yield "of no event", [cuda.EventRecord(None, None), cuda.EventQuery(None)]
    yield "destroy no event", cuda.EventDestroy(None)
    yield "destroy", [cuda.EventDestroy(event), cuda.StreamDestroy(stream)]


def handles(cuda: Any, path: str) -> Answers:
    cuda.begun()
    neighbour = Neighbour(path, START)
    out, two, handle = ctypes.c_void_p(), ctypes.c_void_p(), Handle()
    size, host = ctypes.c_size_t(), (ctypes.c_ubyte * SIZE)()
    own = cuda.made("MemAlloc", 4 << 20)
    yield "of memory", cuda.IpcGetMemHandle(ctypes.byref(handle), own)
    yield "open one's own", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, LAZY_PEER_ACCESS)
    yield "of nothing", cuda.IpcGetMemHandle(ctypes.byref(handle), None)
    yield "close what was not opened", cuda.IpcCloseMemHandle(own)
    yield "close nothing", cuda.IpcCloseMemHandle(None)
    text = "55" * 64
    code = cuda.IpcOpenMemHandle(ctypes.byref(out), as_handle(text), LAZY_PEER_ACCESS)
    yield "open no memory", code
    yield "open no event", cuda.IpcOpenEventHandle(ctypes.byref(out), as_handle(text))
    event, plain = cuda.interprocess_event(), cuda.made("EventCreate", 0)
    yield "of an event", cuda.IpcGetEventHandle(ctypes.byref(handle), event)
    yield "open one's own event", cuda.IpcOpenEventHandle(ctypes.byref(out), handle)
    yield "of a plain event", cuda.IpcGetEventHandle(ctypes.byref(handle), plain)
    offered = neighbour(
        "(m := cuda.made('MemAlloc', 4 << 20), cuda.MemsetD8(m, 7, 4 << 20), cuda.CtxSynchronize(),"
        " as_text(cuda.handle('IpcGetMemHandle', m)))"
    )
    handle = as_handle(offered[-1])
    yield "with flags 0", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, 0)
    yield "open", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, LAZY_PEER_ACCESS)
    at = out.value or 0
    yield "open again", cuda.IpcOpenMemHandle(ctypes.byref(two), handle, LAZY_PEER_ACCESS)
    yield "the same pointer", two.value == at
    code = cuda.MemGetAddressRange(ctypes.byref(out), ctypes.byref(size), at + 77)
    yield "its range", [code, out.value == at, size.value]
    yield "read", [cuda.MemcpyDtoH(host, at, SIZE), host[0], host[SIZE - 1]]
    yield "free what was opened", cuda.MemFree(at)
    yield "close", [cuda.IpcCloseMemHandle(at), cuda.IpcCloseMemHandle(at)]
    yield "close a third time", cuda.IpcCloseMemHandle(at)
    yield "the neighbour frees it", neighbour(f"cuda.MemFree({offered[0]})")
    yield "open freed memory", cuda.IpcOpenMemHandle(ctypes.byref(out), handle, LAZY_PEER_ACCESS)
    event = neighbour(
        "(e := cuda.interprocess_event(), cuda.EventRecord(e, None), cuda.CtxSynchronize(),"
        " as_text(cuda.handle('IpcGetEventHandle', e)))"
    )
    handle = as_handle(event[-1])
    yield "open event", cuda.IpcOpenEventHandle(ctypes.byref(out), handle)
    yield "use it", [cuda.EventQuery(out), cuda.EventSynchronize(out)]
    yield "wait for it", cuda.StreamWaitEvent(None, out, 0)
    yield "event as memory", cuda.IpcOpenMemHandle(ctypes.byref(two), handle, LAZY_PEER_ACCESS)
    yield "destroy it", cuda.EventDestroy(out)
    left = as_handle(
        neighbour("as_text(cuda.handle('IpcGetMemHandle', cuda.made('MemAlloc', 99)))")
    )
    neighbour.leave()
    code = cuda.IpcOpenMemHandle(ctypes.byref(out), left, LAZY_PEER_ACCESS)
    yield "memory of a process that has ended", code


def texts(cuda: Any, _path: str) -> Answers:
    for code in (0, 1, 2, 3, 101, 201, 205, 400, 500, 600, 702, 801, 9999):
        found = []
        for name in ("GetErrorName", "GetErrorString"):
            text = ctypes.c_char_p()
            answer = getattr(cuda, name)(code, ctypes.byref(text))
            found += [answer, text.value and text.value.decode()]
        yield str(code), found


def addresses(cuda: Any, _path: str) -> Answers:
    cuda.Init(0)
    for name in ("cuInit", "cuMemAlloc", "cuIpcOpenMemHandle", "cuNothing", "printf"):
        at, status = ctypes.c_void_p(5), ctypes.c_int(7)
        code = cuda.GetProcAddress(name.encode(), ctypes.byref(at), 12000, 0, ctypes.byref(status))
        yield name, [code, bool(at.value), status.value]


GROUPS = (beginning, contexts, memory, order, handles, texts, addresses)


if __name__ == "__main__":
    if sys.argv[2:] == ["--neighbour"]:
        serve_neighbour(cuda=Driver(sys.argv[1]).begun())
    else:
        tell(Driver(sys.argv[1]), GROUPS, START, *sys.argv[1:])
