"""A ring in CUDA memory of the stand-in, read as rings in memory of the host are."""

import base64

from splatbus_conformance.memory_reading import CannotOpen, Layout, Opened, layout_of
from splatbus_conformance.messages import Json
from splatbus_conformance.stand_in.device import POISON, Device
from splatbus_conformance.values import is_handle, whole


class OpenedOnDevice(Opened):
    """The memory that a handle names; poison, once it was freed."""

    def __init__(self, generation: int, device: Device, handle: str, layout: Layout) -> None:
        self.generation = generation
        self.name = handle
        self.layout = layout
        self._device, self._handle = device, base64.b64decode(handle)

    def size(self) -> int | None:
        """Not shown."""
        return None

    def mode(self) -> int | None:
        """Not shown."""
        return None

    def close(self) -> None:
        """Nothing to do."""

    def _read(self, offset: int, size: int) -> bytes:
        try:
            return self._device.read(self._handle, offset, size)
        except ValueError:
            return POISON * size


def open_on_device(init_packet: Json, device: Device) -> Opened:
    """Open the `cuda_ipc` ring of a 1.1 init packet. Raises CannotOpen."""
    memory, generation = init_packet.get("memory"), whole(init_packet.get("generation"), 1)
    handle = memory.get("handle") if isinstance(memory, dict) else None
    if generation is None or not isinstance(handle, str) or not is_handle(handle):
        raise CannotOpen("generation or memory.handle is none")
    layout = layout_of(init_packet)
    try:
        device.read(base64.b64decode(handle), layout.bytes - 1, 1)
    except ValueError as error:
        raise CannotOpen(str(error)) from None
    return OpenedOnDevice(generation, device, handle, layout)
