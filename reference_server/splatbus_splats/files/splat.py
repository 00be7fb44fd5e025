"""Files `.splat`, of the viewer antimatter15/splat: 32 bytes a Gaussian, and no header.

Position, three float32; standard deviations, three float32; red, green, blue and opacity, four
uint8 of 255; a quaternion w, x, y, z, four uint8, 128 being 0. All little-endian.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.files import container
from splatbus_splats.gaussians import NO_ORIGIN, Gaussians, Vector, counted_from

RECORD = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("turn", "u1", 4)])


def count(file: BufferedReader, path: Path, size: int) -> int:
    """How many Gaussians are in a file of so many bytes.

    Raises:
        ValueError: no file of these has that length, or it begins as those of others do.
    """
    if file.peek(3)[:3] == b"ply":  # where a Gaussian is, is hardly ever such a number
        raise ValueError(f"{path}: no .splat, whatever its name says: it is a .ply")
    if size % RECORD.itemsize:
        whole = size - size % RECORD.itemsize
        raise ValueError(
            f"{path}: {size} bytes are no multiple of {RECORD.itemsize}:"
            f" the Gaussian at byte {whole} is cut short, or it is no .splat"
        )
    return size // RECORD.itemsize


def decoded(rows: NDArray[Any], origin: Vector = NO_ORIGIN) -> Gaussians:
    """What some records say, not yet looked at: quaternions have the norm that they have."""
    turns = rows["turn"].astype(np.float32) - 128.0
    shades = rows["rgba"].astype(np.float32) / np.float32(255.0)
    coefficients = (shades[:, None, :3] - np.float32(0.5)) / np.float32(CONSTANT)
    return Gaussians(
        counted_from(origin, rows["mean"]),
        turns[:, [1, 2, 3, 0]],
        rows["scale"],
        shades[:, 3],
        coefficients,
    )


def parts(
    file: BufferedReader, path: Path, count: int, step: int, origin: Vector
) -> Iterator[tuple[Gaussians, None]]:
    """What the records say, so many at a time; none of them lives in time."""
    for rows in container.blocks(file, path, RECORD, count, step):
        yield decoded(rows, origin), None
