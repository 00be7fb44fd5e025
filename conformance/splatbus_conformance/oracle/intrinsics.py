"""A pinhole's intrinsics in exact arithmetic (spec 1.1 section 5.1: pixel centres at halves)."""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from splatbus_conformance.oracle.rotations import Vector, norm
from splatbus_conformance.oracle.rounding import Real, exact

HALF = Fraction(1, 2)


class Intrinsics(NamedTuple):
    """In pixels; image points are counted from the upper left corner of the image."""

    fx: Real
    fy: Real
    cx: Real
    cy: Real
    width: int
    height: int

    def scaled(self, width: int, height: int) -> "Intrinsics":
        """Return the intrinsics of the same camera for an image of another size."""
        across, down = Fraction(width, self.width), Fraction(height, self.height)
        fx, fy, cx, cy = exact(self[:4])
        return Intrinsics(fx * across, fy * down, cx * across, cy * down, width, height)

    def has_shape_of(self, width: int, height: int) -> bool:
        """Return whether these intrinsics may be scaled to an image of this size (CAM-6)."""
        largest = max(self.width, self.height, width, height)
        return abs(self.height * width - self.width * height) < largest

    def image_point(self, point: Sequence[Real]) -> Vector | None:
        """Return (u, v) of a point in camera axes, None where it is not in front (z ≤ 0)."""
        x, y, z = exact(point)
        fx, fy, cx, cy = exact(self[:4])
        return (fx * x / z + cx, fy * y / z + cy) if z > 0 else None

    def ray(self, u: Real, v: Real) -> Vector:
        """Return the direction in camera axes that an image point shows, with z = 1."""
        fx, fy, cx, cy = exact(self[:4])
        return (Fraction(u) - cx) / fx, (Fraction(v) - cy) / fy, Fraction(1)

    def planar(self, u: Real, v: Real, distance: Real) -> Fraction:
        """Return the planar depth of what an image point shows at a distance along its ray."""
        return Fraction(distance) / norm(self.ray(u, v))

    def device_point(self, u: Real, v: Real) -> Vector:
        """Return OpenGL's normalised device coordinates: −1 to 1, y up."""
        return 2 * Fraction(u) / self.width - 1, 1 - 2 * Fraction(v) / self.height

    def pixel(self, u: Real, v: Real) -> tuple[int, int] | None:
        """Return the column and row that an image point lies in, None outside of the image."""
        column, row = math.floor(Fraction(u)), math.floor(Fraction(v))
        inside = 0 <= column < self.width and 0 <= row < self.height
        return (column, row) if inside else None


def from_opencv(calibration: Intrinsics) -> Intrinsics:
    """Return what a calibration means whose pixel centres are whole numbers."""
    cx, cy = exact((calibration.cx, calibration.cy))
    return calibration._replace(cx=cx + HALF, cy=cy + HALF)
