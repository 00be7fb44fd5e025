"""The Gaussians of one object, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.messages import Box

Floats = NDArray[np.float32]
Vector = NDArray[np.float64]
NO_ORIGIN: Vector = np.zeros(3)

COEFFICIENTS = (1, 4, 9, 16)
"""How many harmonics a channel has, by their degree."""
CELLS = 1 << 10
"""Into which an axis is divided, to say which Gaussians are near each other."""


@dataclass(frozen=True, eq=False)
class Gaussians:
    """N of them in the axes and units of their object, all float32 and contiguous.

    Attributes:
        means: (N, 3), centres.
        rotations: (N, 4), unit quaternions x, y, z, w that turn a Gaussian's own axes into the
            object's.
        scales: (N, 3), standard deviations along its own axes, 0 or more.
        opacities: (N,), in [0, 1].
        coefficients: (N, K, 3), real spherical harmonics of red, green and blue, K one of
            `COEFFICIENTS`. One Gaussian's lie together: a view reads those of the Gaussians in it
            and no others.
    """

    means: Floats
    rotations: Floats
    scales: Floats
    opacities: Floats
    coefficients: Floats

    def __len__(self) -> int:
        return len(self.means)

    def __getitem__(self, which: slice | NDArray[np.int64]) -> Gaussians:
        return Gaussians(*(getattr(self, each.name)[which] for each in fields(self)))

    @property
    def degree(self) -> int:
        """Of the harmonics."""
        return COEFFICIENTS.index(self.coefficients.shape[1])

    @property
    def bounds(self) -> Box | None:
        """The box of the centres; None where there is no Gaussian."""
        if not len(self):
            return None
        (a, b, c), (d, e, f) = self.means.min(axis=0).tolist(), self.means.max(axis=0).tolist()
        return Box((a, b, c), (d, e, f))


def counted_from(origin: Vector, points: NDArray[np.floating[Any]]) -> Floats:
    """(N, 3): points as they lie from there, subtracted before they are rounded."""
    return (points - origin).astype(np.float32)


def empty(count: int, coefficients: int) -> Gaussians:
    """Room for as many Gaussians, with whatever lies there."""
    shapes = ((count, 3), (count, 4), (count, 3), (count,), (count, coefficients, 3))
    return Gaussians(*(np.empty(shape, np.float32) for shape in shapes))


def curve(means: Floats) -> NDArray[np.int64]:
    """(N,), an order in which those that follow each other are near each other.

    Along Morton's curve through the box in which 98 of a hundred lie; of the same cell of 1024³ in
    the order in which they came.
    """
    if not len(means):
        return np.empty(0, np.int64)
    sample = means[:: max(1, len(means) // 10_000)]
    low, high = np.quantile(sample, (0.01, 0.99), axis=0)
    places = (means - low) / np.maximum(high - low, np.finfo(np.float32).tiny)
    cells = np.clip(places * CELLS, 0, CELLS - 1).astype(np.uint32)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cells = (cells | cells << np.uint32(shift)) & np.uint32(mask)
    return np.argsort(cells @ np.array((1, 2, 4), np.uint32), kind="stable")


def along_curve(gaussians: Gaussians) -> Gaussians:
    """The same in the order of `curve`."""
    return gaussians[curve(gaussians.means)]
