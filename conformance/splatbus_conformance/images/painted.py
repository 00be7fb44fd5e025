"""Images that the harness shows to a client: what they hold, where, and how they are digested."""

import hashlib
import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.wire.messages import Json

Floats = NDArray[np.float32]
STEP = 2.0**-15
"""Of the colours that tell where a pixel lies: 32,768 of them fit into 0…1, all exact."""
SPOILT_COLOR, SPOILT_DEPTH = (0.875, 0.625, 0.375, 0.125), 12345.0
"""What a slot holds that nobody may read."""


class Writable(Protocol):
    """Memory of the host or of a device."""

    def write(self, offset: int, data: bytes) -> None:
        """Write bytes."""


class Painting(NamedTuple):
    """An image; rows top-down."""

    color: Floats
    """(h, w, 4) float32: red, green, blue, alpha."""
    depth: Floats
    """(h, w) float32."""

    def digests(self) -> tuple[str, str]:
        """SHA-256 of colour and of depth, as ADAPTER.md says."""
        return sha256(self.color), sha256(self.depth)


def sha256(image: Floats) -> str:
    """Of all pixels as little-endian single precision, rows from the top."""
    return hashlib.sha256(np.ascontiguousarray(image, "<f4").tobytes()).hexdigest()


def coordinates(number: int, width: int, height: int) -> Painting:
    """Every pixel says where it lies (red: column, green: row), and in which image (blue).

    No value survives eight bits or another order of rows. A fifth of the pixels are empty.
    """
    row, column = np.indices((height, width))
    alpha = 1 - (row + column + number) % 8 * 2.0**-24
    blue = np.full((height, width), (number % 32768) * STEP)
    color = np.stack([column * STEP, row * STEP, blue, alpha], -1).astype(np.float32)
    depth = 1 + (row * width + column) % 4096 * 2.0**-10 + number % 1024
    return Painting(color, np.where((row + column) % 5 == 0, math.inf, depth).astype(np.float32))


def spoilt(width: int, height: int) -> Painting:
    """What nobody may show."""
    color = np.broadcast_to(np.array(SPOILT_COLOR, np.float32), (height, width, 4))
    return Painting(color, np.full((height, width), SPOILT_DEPTH, np.float32))


def write(memory: Writable, painting: Painting, slot: int, ring: Json) -> None:
    """Write an image to a slot of the ring of an init packet, rows bottom-up (BUF-1, BUF-2)."""
    for image, name in ((painting.color, "color"), (painting.depth, "depth")):
        rows = np.ascontiguousarray(image[::-1], "<f4")
        memory.write(ring[f"{name}Offset"] + slot * ring[f"{name}Stride"], rows.tobytes())
