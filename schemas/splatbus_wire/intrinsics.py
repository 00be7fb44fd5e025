"""A pinhole camera's intrinsics: from points before it to places on an image, and back [IMG-1].

An image point (u, v) is in pixels, u to the right and v down from the corner of the image, so that
pixel centres are at half-integers: (0.5, 0.5) is the centre of the top-left pixel, and a principal
point (width / 2, height / 2) is the middle of the image, as in COLMAP and 3DGS. OpenCV counts from
the centre of the top-left pixel instead; see `from_opencv`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]
ImagePoint = tuple[float, float]


class Pinhole(NamedTuple):
    """Focal lengths and principal point in pixels of an image of this width and height."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def scaled_to(self, width: int, height: int) -> Pinhole:
        """Return the same camera for an image of another size, within 2 ULP.

        Each axis is scaled on its own [CAM-5]; see `has_shape_of`.
        """
        return Pinhole(
            self.fx * width / self.width,
            self.fy * height / self.height,
            self.cx * width / self.width,
            self.cy * height / self.height,
            width,
            height,
        )

    def as_high(self, width: int, height: int) -> Pinhole:
        """Return the same view, from its upper to its lower edge, for an image of this size.

        Pixels keep their shape, so that an image of another shape shows more or less at its sides,
        and the principal point its distance from the middle, in parts of the height.
        """
        ratio = height / self.height
        return Pinhole(
            self.fx * ratio,
            self.fy * ratio,
            width / 2.0 + (self.cx - self.width / 2.0) * ratio,
            self.cy * ratio,
            width,
            height,
        )

    def has_shape_of(self, width: int, height: int) -> bool:
        """Whether an image of this size has the same aspect ratio, but for rounding [CAM-6].

        A side of the smaller image that was rounded to a whole pixel is rounding: 854 by 480 has
        the shape of 1920 by 1080.
        """
        largest = max(self.width, self.height, width, height)
        return abs(self.height * width - self.width * height) < largest

    def project(self, points: ArrayLike) -> Float64Array:
        """Return the image points (…, 2) of points (…, 3) in camera axes; NaN where z is not > 0.

        (u, v) = (fx·x/z + cx, fy·y/z + cy); it may lie outside of the image.
        """
        x, y, z = np.moveaxis(np.asarray(points, np.float64), -1, 0)
        ahead = np.where(z > 0, z, np.nan)
        return np.stack((self.fx * x / ahead + self.cx, self.fy * y / ahead + self.cy), axis=-1)

    def ray(self, u: ArrayLike, v: ArrayLike) -> Float64Array:
        """Return (…, 3): where image points look, in camera axes, with z = 1.

        Planar depth times this is the point seen; distance along the ray is planar depth times its
        norm.
        """
        x = (np.asarray(u, np.float64) - self.cx) / self.fx
        y = (np.asarray(v, np.float64) - self.cy) / self.fy
        return np.stack(np.broadcast_arrays(x, y, 1.0), axis=-1)

    def rays(self) -> Float64Array:
        """Return (height, width, 3), top row first: `ray` of every pixel's centre."""
        return self.ray(np.arange(self.width) + 0.5, np.arange(self.height)[:, np.newaxis] + 0.5)


def from_opencv(fx: float, fy: float, cx: float, cy: float, width: int, height: int) -> Pinhole:
    """Return what the camera matrix of an OpenCV calibration says, whose pixel centres are whole.

    Half a pixel is added to its principal point; do so before scaling.
    """
    return Pinhole(fx, fy, cx + 0.5, cy + 0.5, width, height)


def pixel_centre(column: int, row: int) -> ImagePoint:
    """Return the image point in the middle of a pixel; columns from the left, rows from the top."""
    return column + 0.5, row + 0.5


def pixel_at(point: ImagePoint, width: int, height: int) -> tuple[int, int] | None:
    """Return the (column, row) that an image point lies in, None outside of the image.

    A pixel holds its left and its upper border.
    """
    u, v = point
    if not (0 <= u < width and 0 <= v < height):
        return None
    return math.floor(u), math.floor(v)
