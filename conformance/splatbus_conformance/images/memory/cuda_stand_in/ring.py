"""Slots for whole images in device memory, as a server of 1.1 lends them."""

from collections.abc import Iterable

from splatbus_conformance.cases.rings import Arrangement, arranged
from splatbus_conformance.images.memory.cuda_stand_in.device import POISON
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, text_of
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.images.memory.cuda_stand_in.usage import is_read
from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.wire.messages import Json, init_packet_1_1

UNUSUAL = Arrangement("depth first", 32, 16, 48)
"""No client guesses it."""


class DeviceRing:
    """Slots in one allocation, an event for each, and the legacy slot beside them."""

    def __init__(self, device: Device, width: int, height: int, slots: int) -> None:
        self._uuid = device.uuid
        self.legacy = DeviceImage(device, width, height)
        self.legacy.draw(0)
        self._packet = arranged(init_packet_1_1("", 0, width, height, slots), UNUSUAL)
        self.layout: Json = self._packet["ring"]
        self._planes = {"color": 16 * width * height, "depth": 4 * width * height}
        self.memory = device.allocate(self._packet["memory"]["bytes"])
        self.events = [device.event() for _ in range(slots)]

    def init_packet(self, generation: int) -> Json:
        """The init packet of 1.1 that names all of it."""
        legacy, memory = self.legacy.init_packet(), self._packet["memory"]
        announced = {
            "kind": "cuda_ipc",
            "deviceUuid": self._uuid,
            "handle": text_of(self.memory.handle),
            "bytes": memory["bytes"],
        }
        events = [text_of(event.handle) for event in self.events]
        return {
            **legacy,
            **self._packet,
            "generation": generation,
            "meta": legacy["meta"],
            "memory": announced,
            "ring": self.layout | {"events": events},
        }

    def spans(self, slot: int) -> list[tuple[int, int]]:
        """Where the colour and the depth of a slot begin and end, in bytes."""
        begins = {
            what: self.layout[f"{what}Offset"] + slot * self.layout[f"{what}Stride"]
            for what in self._planes
        }
        return [(begin, begin + self._planes[what]) for what, begin in begins.items()]

    def fill(self, slot: int, byte: bytes = POISON) -> None:
        """Fill the image of a slot."""
        for begin, end in self.spans(slot):
            self.memory.write(begin, byte * (end - begin))

    def copies(self, calls: Iterable[Call], slot: int) -> list[Call]:
        """The copies that begin in a slot."""
        spans = self.spans(slot)
        mine = (call for call in calls if is_read(call) and call.memory == self.memory.name)
        return [call for call in mine if any(a <= call.offset < b for a, b in spans)]

    def free(self) -> None:
        """Free all of it."""
        self.legacy.free()
        self.memory.free()
        for event in self.events:
            event.free()
