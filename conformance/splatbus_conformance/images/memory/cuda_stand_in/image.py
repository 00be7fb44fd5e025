"""Images that the harness keeps in device memory, as a server of 1.0 does."""

import base64
import zlib
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.images.memory.cuda_stand_in.usage import is_read
from splatbus_conformance.images.memory.device import Allocation, Device
from splatbus_conformance.images.painted import Painting
from splatbus_conformance.wire.messages import Json, init_packet_1_0

PIXEL_BYTES = {"Color": 16, "Depth": 4}


class PlaneOffsets(NamedTuple):
    """Where the planes lie; an offset of None is left out of the packet."""

    color: int | None = 0
    depth: int | None = None
    apart: bool = True
    """Each plane has an allocation of its own."""


class Plane(NamedTuple):
    """One of the two, in bytes."""

    memory: Allocation
    begin: int
    end: int


class DeviceImage:
    """Colour and depth in device memory and the event that guards them; poisoned until drawn."""

    def __init__(
        self, device: Device, width: int = 64, height: int = 48, layout: PlaneOffsets | None = None
    ) -> None:
        self.width, self.height = width, height
        self._layout = layout or PlaneOffsets(0, 16 * width * height, apart=False)
        self._ordinal = device.ordinal
        self.event = device.event()
        pixels = width * height
        ends = {
            what: (getattr(self._layout, what.lower()) or 0) + size * pixels
            for what, size in PIXEL_BYTES.items()
        }
        if self._layout.apart:
            memory = {what: device.allocate(end) for what, end in ends.items()}
        else:
            memory = dict.fromkeys(ends, device.allocate(max(ends.values())))
        self.planes = {
            what: Plane(memory[what], end - PIXEL_BYTES[what] * pixels, end)
            for what, end in ends.items()
        }
        self.names = {plane.memory.name for plane in self.planes.values()}
        self.drawn: dict[str, bytes] = {}
        """The last that was drawn into each plane, as it lies there: the bottom row first."""

    def draw(self, number: int) -> None:
        """Draw the image of this number: random colours, depths from 1 to 99."""
        generator = np.random.default_rng(number)
        pixels = self.width * self.height
        self.drawn = {
            "Color": generator.random(4 * pixels, np.float32).astype("<f4").tobytes(),
            "Depth": (1 + 98 * generator.random(pixels, np.float32)).astype("<f4").tobytes(),
        }
        for what, data in self.drawn.items():
            self.planes[what].memory.write(self.planes[what].begin, data)

    def init_packet(self) -> Json:
        """The init packet of 1.0 that names it."""
        offered = init_packet_1_0(self.width, self.height)
        offered["meta"]["device"] = self._ordinal
        for what, plane in self.planes.items():
            offset = getattr(self._layout, what.lower())
            offered[f"mem_{what.lower()}"] = text_of(plane.memory.handle)
            if offset is None:
                del offered["meta"][f"offset{what}"]
            else:
                offered["meta"][f"offset{what}"] = offset
        return offered | {"evt_done": text_of(self.event.handle)}

    def painting(self) -> Painting:
        """The image that was drawn last."""
        color, depth = (np.frombuffer(self.drawn[what], "<f4") for what in PIXEL_BYTES)
        size = self.height, self.width
        return Painting(color.reshape(*size, 4)[::-1], depth.reshape(size)[::-1])

    def opened(self, calls: Iterable[Call]) -> bool:
        """Whether any of its memory was opened."""
        return any(c.function == "cudaIpcOpenMemHandle" and c.memory in self.names for c in calls)

    def copies(self, calls: Iterable[Call]) -> list[Call]:
        """The copies out of its memory."""
        return [call for call in calls if is_read(call) and call.memory in self.names]

    def is_read_whole(self, calls: Iterable[Call], what: str = "Color") -> bool:
        """Whether every byte of a plane was copied, as it was drawn last."""
        plane = self.planes[what]
        good = (c for c in self.copies(calls) if c.memory == plane.memory.name and self.shows(c))
        reached = plane.begin
        for begin, end in sorted({row for call in good for row in rows_of(call)}):
            reached = max(reached, end) if begin <= reached else reached
        return reached >= plane.end

    def shows(self, call: Call) -> bool:
        """Whether a copy took what was drawn last, and nothing beside it."""
        for what, data in self.drawn.items():
            plane, rows = self.planes[what], rows_of(call)
            within = plane.begin <= rows[0][0] and rows[-1][1] <= plane.end
            if call.memory == plane.memory.name and within:
                copied = (data[a - plane.begin : b - plane.begin] for a, b in rows)
                return zlib.adler32(b"".join(copied)) == call.digest
        return False

    def free(self) -> None:
        """Free its memory and its event."""
        for plane in self.planes.values():
            plane.memory.free()
        self.event.free()


def rows_of(call: Call) -> list[tuple[int, int]]:
    """The rows of a copy that copied something: beginning and end in the memory, in bytes."""
    begins = (call.offset + row * call.pitch for row in range(call.height))
    return [(begin, begin + call.width) for begin in begins]


def text_of(handle: bytes) -> str:
    """A handle as packets carry it (INI-7)."""
    return base64.b64encode(handle).decode()
