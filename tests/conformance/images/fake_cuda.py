"""A CUDA driver with the calls that the harness makes, in memory of this process.

Copies are done at once; streams that wait for a number do not hold up others, so what was recorded
behind such a wait is pending until the number is there.
"""

import ctypes
import itertools
from typing import Any

INVALID_VALUE, INVALID_HANDLE, NOT_READY = 1, 400, 600


class FakeCuda:
    """One process's driver; `neighbour` is that of another process on the same devices."""

    def __init__(self, devices: int = 1, shared: dict[bytes, Any] | None = None) -> None:
        self.devices = devices
        self.shared = {} if shared is None else shared
        self.contexts: list[int] = []
        self.memory: dict[int, Any] = {}
        self.opened: dict[int, bytes] = {}
        self.events: dict[int, Any] = {}
        self.streams: dict[int, list[Any]] = {}
        self.hosts: dict[int, Any] = {}
        self.freed_while_pending = 0
        self._numbers = itertools.count(1)

    def __getattr__(self, name: str) -> Any:
        """Calls that change nothing here."""
        return lambda *given: 0

    def neighbour(self) -> "FakeCuda":
        return FakeCuda(self.devices, self.shared)

    def cuInit(self, flags):  # noqa: N802
        return 0 if self.devices else 100

    def cuDeviceGetCount(self, count):  # noqa: N802
        count._obj.value = self.devices
        return 0

    def cuDeviceGet(self, device, ordinal):  # noqa: N802
        device._obj.value = ordinal
        return 0 if ordinal < self.devices else 101

    def cuDeviceGetUuid_v2(self, uuid, device):  # noqa: N802
        uuid.raw = bytes([device]) * 16
        return 0

    def cuDevicePrimaryCtxRetain(self, context, device):  # noqa: N802
        context._obj.value = 100 + device
        return 0

    def cuCtxPushCurrent_v2(self, context):  # noqa: N802
        self.contexts.append(context)
        return 0

    def cuCtxPopCurrent_v2(self, context):  # noqa: N802
        context._obj.value = self.contexts.pop()
        return 0

    def cuMemAlloc_v2(self, pointer, size):  # noqa: N802
        if not self.contexts:
            return 201
        at = pointer._obj.value = next(self._numbers) << 32
        self.memory[at] = bytearray(size)
        return 0

    def cuMemFree_v2(self, pointer):  # noqa: N802
        self.freed_while_pending += any(self._pending(it) for it in self.streams.values())
        self.shared = {h: it for h, it in self.shared.items() if it is not self.memory[pointer]}
        del self.memory[pointer]
        return 0

    def cuMemGetAddressRange_v2(self, base, size, pointer):  # noqa: N802
        base._obj.value, size._obj.value = pointer, len(self.memory[pointer])
        return 0

    def cuMemHostAlloc(self, pointer, size, flags):  # noqa: N802
        buffer = ctypes.create_string_buffer(size)
        pointer._obj.value = ctypes.addressof(buffer)
        self.hosts[pointer._obj.value] = buffer
        return 0

    def cuMemHostGetDevicePointer_v2(self, there, pointer, flags):  # noqa: N802
        there._obj.value = pointer
        return 0

    def cuMemFreeHost(self, pointer):  # noqa: N802
        del self.hosts[pointer]
        return 0

    def cuMemcpyHtoDAsync_v2(self, to, data, size, stream):  # noqa: N802
        memory, offset = self._at(to)
        memory[offset : offset + size] = data[:size]
        return 0

    def cuMemcpyDtoHAsync_v2(self, to, at, size, stream):  # noqa: N802
        memory, offset = self._at(at)
        to.raw = bytes(memory[offset : offset + size])
        return 0

    def cuMemsetD8Async(self, to, value, size, stream):  # noqa: N802
        memory, offset = self._at(to)
        memory[offset : offset + size] = bytes([value]) * size
        return 0

    def cuStreamCreate(self, stream, flags):  # noqa: N802
        stream._obj.value = next(self._numbers)
        self.streams[stream._obj.value] = []
        return 0

    def cuStreamDestroy_v2(self, stream):  # noqa: N802
        del self.streams[stream]
        return 0

    def cuStreamSynchronize(self, stream):  # noqa: N802
        assert not self._pending(self.streams[stream]), "this would wait for ever"
        return 0

    def cuStreamWaitValue32_v2(self, stream, address, value, flags):  # noqa: N802
        self.streams[stream].append((address, value))
        return 0

    def cuEventCreate(self, event, flags):  # noqa: N802
        assert flags == 6
        event._obj.value = next(self._numbers)
        self.events[event._obj.value] = []
        return 0

    def cuEventRecord(self, event, stream):  # noqa: N802
        self.events[event][:] = self.streams[stream]
        return 0

    def cuEventQuery(self, event):  # noqa: N802
        return NOT_READY if self._pending(self.events[event]) else 0

    def cuEventDestroy_v2(self, event):  # noqa: N802
        del self.events[event]
        return 0

    def cuIpcGetMemHandle(self, handle, pointer):  # noqa: N802
        return self._share(handle, b"memory", self.memory[pointer])

    def cuIpcGetEventHandle(self, handle, event):  # noqa: N802
        return self._share(handle, b"event", self.events[event])

    def cuIpcOpenMemHandle_v2(self, pointer, handle, flags):  # noqa: N802
        found = self.shared.get(bytes(handle))
        if found is None or not bytes(handle).startswith(b"memory"):
            return INVALID_VALUE
        if bytes(handle) in self.opened.values():
            return INVALID_HANDLE  # CUD-2: not twice
        at = pointer._obj.value = next(self._numbers) << 32
        self.memory[at], self.opened[at] = found, bytes(handle)
        return 0

    def cuIpcOpenEventHandle(self, event, handle):  # noqa: N802
        found = self.shared.get(bytes(handle))
        if found is None or not bytes(handle).startswith(b"event"):
            return INVALID_VALUE
        event._obj.value = next(self._numbers)
        self.events[event._obj.value] = found
        return 0

    def cuIpcCloseMemHandle(self, pointer):  # noqa: N802
        del self.memory[pointer], self.opened[pointer]
        return 0

    def cuGetErrorName(self, status, name):  # noqa: N802
        name._obj.value = f"CUDA_ERROR_{status}".encode()
        return 0

    def _share(self, handle, kind, what):
        handle.raw = (kind + b" %d" % id(what)).ljust(64, b"\0")
        self.shared[handle.raw] = what
        return 0

    def _at(self, pointer):
        base = pointer >> 32 << 32
        return self.memory[base], pointer - base

    @staticmethod
    def _pending(waits) -> bool:
        return any(ctypes.c_uint32.from_address(at).value < value for at, value in waits)
