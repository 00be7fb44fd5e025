"""Draws Gaussians on the processor, as `SPLATS.md` says: tiles of 16×16 pixels, and one sort."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_server.view import Intrinsics

from splatbus_splats import kernels
from splatbus_splats.definition import Image, Placed, depths, slopes

MOST_LISTED = 1 << 26
"""Gaussians in the lists of tiles at a time, each for every tile that it is in: 256 MB. Where they
are more, rows of tiles are listed one after the other."""


def rendered(
    objects: Sequence[Placed], intrinsics: Intrinsics, width: int, height: int, threads: int = 1
) -> Image:
    """The image, (height, width, 4) and (height, width), float32.

    All objects are sorted together, each drawn by its one matrix; see `definition.placed`. Runs
    without the interpreter's lock. The first call loads or compiles the loops, which takes some
    seconds. Memory is 100 bytes a Gaussian, and 4 for each tile that it is in, up to `MOST_LISTED`
    or what is in one row of tiles.

    Args:
        objects: what is seen.
        intrinsics: in pixels.
        width: of the image, pixels.
        height: of the image, pixels.
        threads: that draw tiles; the bits do not depend on it.
    """
    room = sum(len(each.gaussians) for each in objects)
    z = np.empty(room)
    shape, box = np.empty((room, 5)), np.empty((room, 4), np.int32)
    paint = np.empty((room, 5), np.float32)
    fx, fy, cx, cy = (float(each) for each in intrinsics[:4])
    near, far = depths(intrinsics)
    count = 0
    for gaussians, turn, eye in objects:
        count = kernels.project(
            gaussians.means,
            gaussians.rotations,
            gaussians.scales,
            gaussians.opacities,
            gaussians.coefficients,
            np.ascontiguousarray(turn),
            eye,
            (fx, fy, cx, cy),
            (*slopes(fx, cx, width), *slopes(fy, cy, height)),
            (float(near), float(far)),
            (width, height),
            count,
            z,
            shape,
            box,
            paint,
        )
    box, order = box[:count], np.argsort(z[:count], kind="stable")

    across, down = -(-width // kernels.TILE), -(-height // kernels.TILE)
    counts = np.zeros(across * down + 1, np.int64)
    kernels.count_tiles(box, across, counts)
    starts = np.cumsum(counts)
    image = Image(np.empty((height, width, 4), np.float32), np.empty((height, width), np.float32))
    with ThreadPoolExecutor(threads) as pool:
        for first, last in _bands(starts, across):
            begins = starts - starts[first]
            lists = np.empty(begins[last], np.int32)
            kernels.list_tiles(order, box, across, first, last, begins[first:last].copy(), lists)

            def blend(begin: int, end: int, begins: Any = begins, lists: Any = lists) -> None:
                kernels.blend(begins, lists, shape, box, paint, begin, end, across, *image)

            shares = np.linspace(0, begins[last], threads + 1)[1:-1]
            cuts = first + np.searchsorted(begins[first:last], shares)
            list(pool.map(blend, (first, *cuts.tolist()), (*cuts.tolist(), last)))
    return image


def _bands(starts: NDArray[np.int64], across: int) -> Iterator[tuple[int, int]]:
    """The tiles from one until before another, whole rows, whose lists are made at a time."""
    first = 0
    for last in range(across, len(starts), across):
        following = last + across
        if following >= len(starts) or starts[following] - starts[first] > MOST_LISTED:
            yield first, last
            first = last
