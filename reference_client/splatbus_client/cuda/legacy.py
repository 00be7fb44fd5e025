"""The buffers of 1.0, which their server overwrites while we read: looked at by copies of our own.

The copy is made on the GPU when the image is read first, behind the server's event [BUF-11]. Even
so it may be of two images: nothing in 1.0 tells a server not to write meanwhile.
"""

from contextlib import ExitStack, suppress
from typing import Any

from splatbus_wire.init_packet import CudaMemory, InitPacket, Slots

from splatbus_client.cuda.driver import CudaError, Device, api, call, device, numbered
from splatbus_client.cuda.images import CudaImages, opened_event, opened_memory

_COLOR_BYTES, _DEPTH_BYTES = 16, 4
_DISABLE_TIMING = 2


class LegacyImages(CudaImages):
    """Slot 0 is our copy of what the server shows; it is taken anew once the last was given back.

    Args:
        packet: a valid init packet with the members of 1.0.

    Raises:
        CannotOpenError: its device, memory or event cannot be opened here; the message says why.
    """

    def __init__(self, packet: InitPacket) -> None:
        self._taken = False
        super().__init__(packet)
        self.semantics = self.semantics._replace(alpha="straight")  # [MEM-15]

    def finish(self, slot: int) -> None:
        """Wait until all reads of the copy were seen to finish; the next one is taken anew."""
        super().finish(slot)
        self._taken = False

    def close(self) -> bool:
        """Unmap once our copy is made, and return True; or False while somebody still has it."""
        if self._taken:
            with self._device.current(), suppress(CudaError):  # of a device that has failed
                call(api.cuStreamSynchronize, self._stream)
        return super().close()

    def _find(self, packet: InitPacket) -> Device:
        assert packet.legacy is not None
        if isinstance(packet.memory, CudaMemory):
            return device(packet.memory.device_uuid)
        return numbered(packet.legacy.device or 0)

    def _open(self, packet: InitPacket, undo: ExitStack) -> tuple[int, Slots, list[Any]]:
        legacy, pixels = packet.legacy, packet.width * packet.height
        assert legacy is not None
        sizes = _COLOR_BYTES * pixels, _DEPTH_BYTES * pixels
        places = (legacy.mem_color, legacy.offset_color), (legacy.mem_depth, legacy.offset_depth)
        self._planes = []
        for (handle, offset), size in zip(places, sizes):
            pointer, room = opened_memory(self._device, handle, undo)
            if offset + size > room:
                raise CudaError(f"an image ends at byte {offset + size} of {room}")
            self._planes.append((pointer + offset, size))
        self._server_event = opened_event(legacy.evt_done, undo)
        ours = call(api.cuMemAlloc, sum(sizes))
        undo.callback(call, api.cuMemFree, ours)
        done = call(api.cuEventCreate, _DISABLE_TIMING)
        undo.callback(call, api.cuEventDestroy, done)
        return int(ours), Slots(1, 0, sizes[0], sizes[0], sizes[1]), [done]

    def _order(self, stream: Any, slot: int) -> None:
        if not self._taken:
            self._take()
        super()._order(stream, slot)

    def _take(self) -> None:
        call(api.cuStreamWaitEvent, self._stream, self._server_event, 0)
        target = self._pointer
        for source, size in self._planes:
            call(api.cuMemcpyDtoDAsync, target, source, size, self._stream)
            target += size
        call(api.cuEventRecord, self._events[0], self._stream)
        self._taken = True
