"""Gaussians that lie one after the other, and near each other: looked at together first.

A run whose Gaussians can reach no pixel that is still to be drawn is left as it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_server.view import Intrinsics

from splatbus_splats.drawing.definition import LEAST_ALPHA, LOW_PASS, Placed, depths, slopes
from splatbus_splats.gaussians import Gaussians

Floats = NDArray[np.float64]

LENGTH = 1 << 10
"""Gaussians in a run, the last of an object excepted."""
REACH = math.sqrt(-2.0 * math.log(LEAST_ALPHA))
"""How many standard deviations from its centre an opaque Gaussian can be seen."""
SLACK = 1e-6
"""Relative, by which runs are larger than they need be, for what rounding does."""


class Bounds(NamedTuple):
    """Of the R runs of an object, in its axes and units."""

    centers: Floats
    """(R, 3), of their boxes, which hold the centres of their Gaussians."""
    halves: Floats
    """(R, 3), half the boxes' sizes."""
    largest: Floats
    """(R,), standard deviations."""


class Outlines(NamedTuple):
    """Of R runs in a view."""

    nearest: Floats
    """(R,), depths that none of theirs is nearer than."""
    boxes: Floats
    """(R, 4), the first column that they can reach, pixels, the last, and rows likewise."""


def bounds_of(gaussians: Gaussians) -> Bounds:
    """Of the runs of an object, each `LENGTH` long."""
    if not len(gaussians):
        return Bounds(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    begins = np.arange(0, len(gaussians), LENGTH)
    least = np.minimum.reduceat(gaussians.means, begins).astype(np.float64)
    most = np.maximum.reduceat(gaussians.means, begins).astype(np.float64)
    largest = np.maximum.reduceat(gaussians.scales.max(axis=1), begins).astype(np.float64)
    return Bounds((least + most) / 2.0, (most - least) / 2.0, largest)


def outlines(
    bounds: Bounds, placed: Placed, intrinsics: Intrinsics, width: int, height: int
) -> Outlines:
    """Where the Gaussians of each run may be seen.

    A box's projection lies between those of its corners; a Gaussian at depth z adds no more than
    `REACH` times √(f²(1 + x̂²)σ²/z² + 0.3), and no less than z > `depths` is drawn.
    """
    turn = placed.turn
    scale = float(np.linalg.norm(turn[0]))
    center = (bounds.centers - placed.eye) @ turn.T
    half = bounds.halves @ np.abs(turn).T * (1.0 + SLACK) + SLACK * np.abs(center)
    near, far = depths(intrinsics)
    nearest, farthest = center[:, 2] - half[:, 2], center[:, 2] + half[:, 2]
    least, most = np.maximum(nearest, near), np.minimum(np.maximum(farthest, near), far)
    sides = []
    for axis, (focal, middle, size) in enumerate(
        zip(intrinsics[:2], intrinsics[2:4], (width, height))
    ):
        steepest = max(abs(each) for each in slopes(focal, middle, size))
        reach = half[:, axis] + REACH * math.hypot(1.0, steepest) * scale * bounds.largest
        low, high = center[:, axis] - reach, center[:, axis] + reach
        edge = REACH * math.sqrt(LOW_PASS) + 1.0
        sides.append(middle - edge + focal * low / np.where(low > 0.0, most, least))
        sides.append(middle + edge + focal * high / np.where(high > 0.0, least, most))
    boxes = np.stack(sides, axis=1)
    boxes[(farthest <= near) | (nearest > far)] = -1.0  # none of it is drawn
    return Outlines(nearest, boxes)


def tiles_of(boxes: Floats, tile: int, across: int, down: int) -> NDArray[np.int64]:
    """(R, 4), the first column of tiles that a run can reach, the one after its last, and rows."""
    tiles = np.floor(boxes / tile)
    tiles[:, 1::2] += 1.0
    return np.clip(tiles, 0, (across, across, down, down)).astype(np.int64)


def reaching(tiles: NDArray[np.int64], is_due: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(R,), which runs can reach a tile that is due, of (down, across)."""
    sums = np.zeros((is_due.shape[0] + 1, is_due.shape[1] + 1), np.int64)
    sums[1:, 1:] = is_due.cumsum(axis=0).cumsum(axis=1)
    left, right, top, bottom = tiles.T
    inside = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    return np.asarray((inside > 0) & (left < right) & (top < bottom))
