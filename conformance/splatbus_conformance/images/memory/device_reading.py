"""A ring in CUDA memory, read as rings in memory of the host are."""

import base64
from collections.abc import Sequence

from splatbus_conformance.images.memory.cuda_stand_in.device import POISON
from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.images.memory.reading import CannotOpen, Opened, RingLayout, layout_of
from splatbus_conformance.wire.json_values import is_handle, whole
from splatbus_conformance.wire.messages import Json


class OpenedOnDevice(Opened):
    """The memory that a handle names, each slot behind its event; poison, once it was freed."""

    def __init__(
        self,
        generation: int,
        device: Device,
        handle: str,
        events: Sequence[bytes],
        layout: RingLayout,
    ) -> None:
        self.generation = generation
        self.name = handle
        self.layout = layout
        self._device, self._handle, self._events = device, base64.b64decode(handle), events

    def size(self) -> int | None:
        """Not shown."""
        return None

    def mode(self) -> int | None:
        """Not shown."""
        return None

    def close(self) -> None:
        """Let go of it; what is read again is opened again."""
        for handle in (self._handle, *self._events):
            self._device.forget(handle)

    def check(self) -> None:
        """Raises ValueError if the memory ends too early, or an event cannot be opened."""
        try:
            for event in self._events:
                self._device.read(self._handle, self.layout.bytes - 1, 1, event)
        except ValueError:
            self.close()
            raise

    def _read(self, slot: int, offset: int, size: int) -> bytes:
        try:
            return self._device.read(self._handle, offset, size, self._events[slot])
        except (IndexError, ValueError):
            return POISON * size


def open_on_device(init_packet: Json, device: Device) -> Opened:
    """Open the `cuda_ipc` ring of a 1.1 init packet. Raises CannotOpen."""
    memory, ring = init_packet.get("memory"), init_packet.get("ring")
    generation = whole(init_packet.get("generation"), 1)
    handle, uuid = (
        (memory.get(name) for name in ("handle", "deviceUuid"))
        if isinstance(memory, dict)
        else (None, None)
    )
    if generation is None or not isinstance(handle, str) or not is_handle(handle):
        raise CannotOpen("generation or memory.handle is none")
    events = ring.get("events") if isinstance(ring, dict) else None
    if not isinstance(events, list) or not all(map(is_handle, events)):
        raise CannotOpen("ring.events are no handles")
    layout = layout_of(init_packet)
    if len(events) != layout.slots:
        raise CannotOpen(f"there are {layout.slots} slots, and {len(events)} events")
    handles = [base64.b64decode(event) for event in events]
    try:
        opened = OpenedOnDevice(generation, device.named(uuid), handle, handles, layout)
        opened.check()
    except ValueError as error:
        raise CannotOpen(str(error)) from None
    return opened
