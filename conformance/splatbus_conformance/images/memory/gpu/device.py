"""A GPU with the face of `device_memory.Device`.

An event that is pending is one that was recorded behind a wait of its stream for a number in memory
of the host, which `complete` writes: the driver itself then holds up whoever waits for the event.
"""

import contextlib
import ctypes
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import c_int, c_size_t, c_uint64, c_void_p
from typing import Any

from splatbus_conformance.images.memory.gpu.driver import (
    HANDLE_BYTES,
    UUID_BYTES,
    CudaError,
    Driver,
    Handle,
    load,
)

POISON_BYTE = 0xFF
NON_BLOCKING = 1  # CU_STREAM_NON_BLOCKING
EVENT_FLAGS = 2 | 4  # CU_EVENT_DISABLE_TIMING, CU_EVENT_INTERPROCESS
LAZY_PEER_ACCESS = 1
HOST_MAPPED = 1 | 2  # CU_MEMHOSTALLOC_PORTABLE, CU_MEMHOSTALLOC_DEVICEMAP
AT_LEAST = 0  # CU_STREAM_WAIT_VALUE_GEQ
NOT_READY = 600
BLOCK_BYTES = 1 << 21
"""The driver shares memory in blocks of this size: an allocation of whole blocks has no neighbour
in what its handle opens."""
EVENT_SECONDS = 5.0
GLANCE_SECONDS = 0.0005


def find() -> "GpuDevice | None":
    """The first GPU that this process sees; None where none can be used."""
    try:
        driver = Driver(load())
        driver.call("cuInit", 0)
        return GpuDevice(driver) if driver.made("cuDeviceGetCount", c_int) else None
    except (OSError, AttributeError):  # no driver, no device, or a driver that is too old
        return None


class GpuDevice:
    """The GPU of this number. Its context is made when it is first used. Raises CudaError."""

    def __init__(self, driver: Driver, ordinal: int = 0) -> None:
        self.driver, self.ordinal = driver, ordinal
        self._device = driver.made("cuDeviceGet", c_int, ordinal)
        identity = driver.bytes_of("cuDeviceGetUuid_v2", UUID_BYTES, self._device)
        self.uuid = f"GPU-{uuid.UUID(bytes=identity)}"
        self.events: list[GpuEvent] = []
        self.allocations: list[GpuAllocation] = []
        self._memories: dict[bytes, int] = {}
        self._foreign_events: dict[bytes, int] = {}
        self._others: dict[object, GpuDevice] = {}
        self._context: int | None = None
        self._stream = 0

    @property
    def stream(self) -> int:
        """For copies; nothing else waits for it, nor it for anything else."""
        return self._stream

    def fits(self) -> float:
        """How often what is held of its memory, by anybody, would fit into what is free."""
        free, whole = c_size_t(), c_size_t()
        with self.current():
            self.driver.call("cuMemGetInfo_v2", ctypes.byref(free), ctypes.byref(whole))
        return free.value / max(whole.value - free.value, 1)

    def named(self, uuid: object) -> "GpuDevice":
        """The device with this UUID; ValueError if this process sees none."""
        if uuid == self.uuid:
            return self
        if not self._others:
            ordinals = range(self.driver.made("cuDeviceGetCount", c_int))
            others = [GpuDevice(self.driver, it) for it in ordinals if it != self.ordinal]
            self._others = {other.uuid: other for other in others}
        if uuid not in self._others:
            seen = ", ".join([self.uuid, *map(str, self._others)])
            raise ValueError(f"memory.deviceUuid is {uuid}, and the harness sees {seen}")
        return self._others[uuid]

    def allocate(self, size: int) -> "GpuAllocation":
        """Device memory; CudaError if there is no room."""
        self.allocations.append(allocation := GpuAllocation(self, size))
        return allocation

    def event(self) -> "GpuEvent":
        """An interprocess event that was never recorded: nobody waits for it."""
        self.events.append(event := GpuEvent(self))
        return event

    def read(self, handle: bytes, offset: int, size: int, after: bytes | None = None) -> bytes:
        """Bytes of the memory that a handle names, behind the event that `after` names.

        ValueError if there is no such memory or event, or the event is not complete in time.
        """
        with self.current():
            try:
                pointer = self._opened(handle)
                room = c_size_t()
                self.driver.call(
                    *("cuMemGetAddressRange_v2", ctypes.byref(c_uint64())),
                    *(ctypes.byref(room), pointer),
                )
                if offset + size > room.value:
                    raise ValueError(f"the memory ends before byte {offset + size}")
                if after is not None:
                    self._wait_for(self._opened_event(after))
                data = ctypes.create_string_buffer(size)
                self.driver.call("cuMemcpyDtoHAsync_v2", data, pointer + offset, size, self.stream)
                self.driver.call("cuStreamSynchronize", self.stream)
            except CudaError as error:
                raise ValueError(str(error)) from None
        return data.raw

    def forget(self, handle: bytes) -> None:
        """Let go of memory, or of an event, that was read; what is not known is no matter."""
        with self.current(), contextlib.suppress(CudaError):
            if pointer := self._memories.pop(handle, None):
                self.driver.call("cuIpcCloseMemHandle", pointer)
            if event := self._foreign_events.pop(handle, None):
                self.driver.call("cuEventDestroy_v2", event)

    def close(self) -> None:
        """Free everything, and the context."""
        for other in self._others.values():
            other.close()
        if self._context is None:
            return
        for handle in (*self._memories, *self._foreign_events):
            self.forget(handle)
        free = [it.free for it in self.allocations] + [it.free for it in self.events]
        for each in free:
            with contextlib.suppress(CudaError):
                each()
        with contextlib.suppress(CudaError):
            with self.current():
                self.driver.call("cuStreamDestroy_v2", self._stream)
            self.driver.call("cuDevicePrimaryCtxRelease_v2", self._device)
        self._context = None

    def complete_all(self) -> None:
        """Let nothing be pending: the driver waits for all of it before it frees memory."""
        for event in self.events:
            event.complete()

    @contextmanager
    def current(self) -> Iterator[None]:
        """The context is this thread's for the block. Raises CudaError."""
        if self._context is None:
            self._context = self.driver.made("cuDevicePrimaryCtxRetain", c_void_p, self._device)
            with self.current():
                self._stream = self.driver.made("cuStreamCreate", c_void_p, NON_BLOCKING)
        self.driver.call("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self.driver.made("cuCtxPopCurrent_v2", c_void_p)

    def _opened(self, handle: bytes) -> int:
        if handle not in self._memories:
            memory = Handle.from_buffer_copy(handle)
            self._memories[handle] = self.driver.made(
                "cuIpcOpenMemHandle_v2", c_uint64, memory, LAZY_PEER_ACCESS
            )
        return self._memories[handle]

    def _opened_event(self, handle: bytes) -> int:
        if handle not in self._foreign_events:
            event = Handle.from_buffer_copy(handle)
            self._foreign_events[handle] = self.driver.made("cuIpcOpenEventHandle", c_void_p, event)
        return self._foreign_events[handle]

    def _wait_for(self, event: int) -> None:
        deadline = time.monotonic() + EVENT_SECONDS
        while (status := self.driver.status("cuEventQuery", event)) == NOT_READY:
            if time.monotonic() > deadline:
                raise ValueError(f"the event was pending for {EVENT_SECONDS:g} s")
            time.sleep(GLANCE_SECONDS)
        if status:
            raise CudaError(f"cuEventQuery: error {status}")


class GpuAllocation:
    """`size` bytes of device memory, poisoned."""

    def __init__(self, device: GpuDevice, size: int) -> None:
        self.size = size
        self._device = device
        with device.current():
            blocks = -(-size // BLOCK_BYTES) * BLOCK_BYTES
            self._pointer: int | None = device.driver.made("cuMemAlloc_v2", c_uint64, blocks)
            self.handle = device.driver.bytes_of("cuIpcGetMemHandle", HANDLE_BYTES, self._pointer)
        self.name = self.handle.hex()
        self.poison()

    def write(self, offset: int, data: bytes) -> None:
        """Write bytes, and wait until they are there; ValueError beyond its end."""
        if not 0 <= offset <= self.size - len(data):
            raise ValueError(f"{len(data)} bytes at {offset} of {self.size}")
        self._do("cuMemcpyHtoDAsync_v2", offset, data, len(data))

    def poison(self) -> None:
        """Spoil all of it."""
        self._do("cuMemsetD8Async", 0, POISON_BYTE, self.size)

    def free(self) -> None:
        """Spoil and free it; once is enough."""
        if self._pointer is None:
            return
        self._device.complete_all()
        self.poison()
        with self._device.current():
            self._device.driver.call("cuMemFree_v2", self._pointer)
        self._pointer = None
        self._device.allocations.remove(self)

    def _do(self, name: str, offset: int, *arguments: Any) -> None:
        assert self._pointer is not None, "the memory was freed"
        driver, stream = self._device.driver, self._device.stream
        with self._device.current():
            driver.call(name, self._pointer + offset, *arguments, stream)
            driver.call("cuStreamSynchronize", stream)


class GpuEvent:
    """An interprocess event, and a stream of its own that can be held up."""

    def __init__(self, device: GpuDevice) -> None:
        self._device, self._driver = device, device.driver
        made = self._driver.made
        with device.current():
            self._event: int | None = made("cuEventCreate", c_void_p, EVENT_FLAGS)
            self.handle = self._driver.bytes_of("cuIpcGetEventHandle", HANDLE_BYTES, self._event)
            self._stream = made("cuStreamCreate", c_void_p, NON_BLOCKING)
            self._flag = made("cuMemHostAlloc", c_void_p, 4, HOST_MAPPED)
            self._flag_there = made("cuMemHostGetDevicePointer_v2", c_uint64, self._flag, 0)
        self.name = self.handle.hex()
        self._records = 0
        self._done = ctypes.c_uint32.from_address(self._flag)
        self._done.value = 0

    def begin(self) -> None:
        """Record it behind work that is not done yet: who waits now, waits for `complete`."""
        self._records += 1
        with self._device.current():
            self._driver.call(
                *("cuStreamWaitValue32_v2", self._stream, self._flag_there),
                *(self._records, AT_LEAST),
            )
            self._driver.call("cuEventRecord", self._event, self._stream)

    def complete(self) -> None:
        """The work before the last record is done."""
        if self._event is not None:
            self._done.value = self._records
            with self._device.current():
                self._driver.call("cuStreamSynchronize", self._stream)

    def free(self) -> None:
        """Destroy it; once is enough."""
        if self._event is None:
            return
        self.complete()
        with self._device.current():
            self._driver.call("cuEventDestroy_v2", self._event)
            self._driver.call("cuStreamDestroy_v2", self._stream)
            self._driver.call("cuMemFreeHost", self._flag)
        self._event = None
        self._device.events.remove(self)
