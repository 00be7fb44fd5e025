"""Draws Gaussians on the processor, as `SPLATS.md` says: tiles of 16×16 pixels, and one sort."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from splatbus_server.view import Intrinsics

from splatbus_splats import kernels
from splatbus_splats.definition import Image, Placed, depths, slopes


def rendered(
    objects: Sequence[Placed], intrinsics: Intrinsics, width: int, height: int, threads: int = 1
) -> Image:
    """The image, (height, width, 4) and (height, width), float32.

    All objects are sorted together, each drawn by its one matrix; see `definition.placed`. Runs
    without the interpreter's lock. The first call loads or compiles the loops,
    which takes some seconds. Memory is 90 bytes a Gaussian, and 4 for each tile that it is in.

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
    lists = np.empty(starts[-1], np.int32)
    kernels.list_tiles(order, box, across, starts[:-1].copy(), lists)
    image = Image(np.empty((height, width, 4), np.float32), np.empty((height, width), np.float32))
    cuts = np.searchsorted(starts, np.linspace(0, starts[-1], threads + 1)[1:-1])
    first, last = [0, *cuts.tolist()], [*cuts.tolist(), across * down]

    def blend(begin: int, end: int) -> None:
        kernels.blend(starts, lists, shape, box, paint, begin, end, across, *image)

    if threads == 1:
        blend(0, across * down)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(blend, first, last))
    return image
