"""The ring of one init packet in memory of a GPU: opened, waited for, read, closed."""

from __future__ import annotations

import ctypes
import math
import weakref
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.errors import ProtocolError
from splatbus_wire.init_packet import CudaMemory, InitPacket, Slots, check_fits
from splatbus_wire.semantics import Semantics

from splatbus_client.cuda.arrays import DeviceArray
from splatbus_client.cuda.driver import CudaError, Device, api, call, device, filled
from splatbus_client.cuda.opened import Allocation, close_memory, open_memory
from splatbus_client.host_memory import CannotOpenError

Image = NDArray[np.float32]
_CUDA = 2  # DLPack's kDLCUDA
_NON_BLOCKING = 1


class CudaImages:
    """What `HostImages` is, for `cuda_ipc`; reads of a slot happen on the GPU, in their own time.

    Args:
        packet: a valid init packet that announces `cuda_ipc` and a ring.

    Raises:
        CannotOpenError: its device, memory or events cannot be opened here; the message says why.
    """

    def __init__(self, packet: InitPacket) -> None:
        self.generation = packet.generation or 0
        self.semantics = packet.semantics or Semantics()
        self.size = packet.width, packet.height
        self._staging: dict[str, Image] = {}
        self._arrays: weakref.WeakSet[DeviceArray] = weakref.WeakSet()
        self._readers: dict[int, set[int | None]] = {}  # streams that read a slot
        try:
            self._device = self._find(packet)
            with self._device.current(), ExitStack() as undo:
                self._pointer, self._ring, self._events = self._open(packet, undo)
                self._stream = call(api.cuStreamCreate, _NON_BLOCKING)
                undo.callback(call, api.cuStreamDestroy, self._stream)
                self._undo = undo.pop_all()
        except (CudaError, ProtocolError) as problem:
            raise CannotOpenError(str(problem)) from None

    def color(self, slot: int) -> DeviceArray:
        """Return (h, w, 4) float32, RGBA, rows bottom-up, where it lies."""
        offset = self._ring.color_offset + slot * self._ring.color_stride
        return self._array(slot, offset, (4,))

    def depth(self, slot: int) -> DeviceArray:
        """Return (h, w) float32, rows bottom-up, where it lies."""
        return self._array(slot, self._ring.depth_offset + slot * self._ring.depth_stride, ())

    def on_host(self, name: str, slot: int, array: DeviceArray) -> Image:
        """Copy an array of a slot to the host, once, and return it with its rows top-down.

        The same memory is used for every frame: copy what is to outlive this one.

        Raises:
            CudaError: the driver refuses the copy, or the device failed before it was done.
        """
        with self._device.current():
            if name not in self._staging:
                self._staging[name] = _pinned(self._device, array.shape)
            image = self._staging[name]
            self._order(self._stream, slot)
            address = image.ctypes.data
            call(api.cuMemcpyDtoHAsync, address, array.pointer, image.nbytes, self._stream)
            call(api.cuStreamSynchronize, self._stream)
        rows = image[::-1]
        rows.flags.writeable = False
        return rows

    def copied(self, name: str, slot: int, array: DeviceArray) -> Image:
        """Copy an array of a slot to memory of the host that stays; errors as of `on_host`."""
        return np.array(self.on_host(name, slot, array))

    def lost(self) -> None:
        """Return None: memory of a GPU stays for whoever has opened it."""

    def finish(self, slot: int) -> None:
        """Wait until all reads of a slot were seen to finish [IMG-13].

        Raises:
            CudaError: the device failed: nobody can say whether they did.
        """
        streams = self._readers.pop(slot, None)
        if streams:
            with self._device.current():
                if None in streams:
                    call(api.cuCtxSynchronize)
                else:
                    for stream in streams:
                        call(api.cuStreamSynchronize, stream)

    def close(self) -> bool:
        """Unmap, and return True; or False while somebody still has an array of it [CUD-5]."""
        if self._arrays:
            return False
        for slot in list(self._readers):
            self.finish(slot)
        with self._device.current(), suppress(CudaError):  # of a device that has failed
            self._undo.close()
        return True

    def _find(self, packet: InitPacket) -> Device:
        assert isinstance(packet.memory, CudaMemory)
        return device(packet.memory.device_uuid)

    def _open(self, packet: InitPacket, undo: ExitStack) -> tuple[int, Slots, list[Any]]:
        """Return where the ring begins, what it looks like, and the event of each slot."""
        assert isinstance(packet.memory, CudaMemory)
        assert packet.ring is not None
        pointer, size = opened_memory(self._device, packet.memory.handle, undo)
        check_fits(packet, size)
        return pointer, packet.ring, [opened_event(handle, undo) for handle in packet.ring.events]

    def _order(self, stream: Any, slot: int) -> None:
        """Make a stream wait for the image in a slot."""
        call(api.cuStreamWaitEvent, stream, self._events[slot], 0)

    def _array(self, slot: int, offset: int, channels: tuple[int, ...]) -> DeviceArray:
        width, height = self.size
        where = _CUDA, self._device.ordinal
        array = DeviceArray(
            self._pointer + offset, (height, width, *channels), where, self._reader(slot)
        )
        self._arrays.add(array)
        return array

    def _reader(self, slot: int) -> Callable[[int | None], int]:
        def read_on(stream: int | None) -> int:
            """Make the stream wait for the image; an unknown one shall wait for our own [IMG-8]."""
            self._readers.setdefault(slot, set()).add(stream)
            waits: Any = self._stream if stream is None else stream
            with self._device.current():
                self._order(waits, slot)
            return int(waits)

        return read_on


def opened_memory(device: Device, handle: bytes, undo: ExitStack) -> Allocation:
    """Map an allocation until `undo` is closed; errors as of `open_memory`."""
    allocation = open_memory(device, handle)
    undo.callback(close_memory, device, handle)
    return allocation


def opened_event(handle: bytes, undo: ExitStack) -> Any:
    """Open an event until `undo` is closed.

    Raises:
        CudaError: the handle is of no use here.
    """
    event = call(api.cuIpcOpenEventHandle, filled(api.CUipcEventHandle(), handle))
    undo.callback(call, api.cuEventDestroy, event)
    return event


def _pinned(device: Device, shape: tuple[int, ...]) -> Image:
    """Memory of the host that the GPU copies to at full speed; freed with the last array of it."""
    size = 4 * math.prod(shape)
    address = int(call(api.cuMemAllocHost, size))
    buffer = (ctypes.c_char * size).from_address(address)

    def free() -> None:
        with suppress(CudaError), device.current():
            call(api.cuMemFreeHost, address)

    weakref.finalize(buffer, free).atexit = False
    everything: Image = np.frombuffer(memoryview(buffer), np.float32)
    return everything.reshape(shape)
