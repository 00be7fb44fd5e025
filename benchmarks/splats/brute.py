"""The floor: the renderer's own loops, for every Gaussian at every pixel."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from splatbus_server.view import Intrinsics
from splatbus_splats.drawing.definition import Image, Placed
from splatbus_splats.drawing.kernels import blend, listing
from splatbus_splats.drawing.kernels.compiled import TILE
from splatbus_splats.drawing.renderer import Renderer
from splatbus_splats.drawing.skips import EXACT, NOTHING

from benchmarks import _shared
from benchmarks.splats import drawn, scenes

BESIDE = ((10_000, (640, 480)), (30_000, (320, 240)), (100_000, (160, 120)))
"""Gaussians and pixels: it takes a nanosecond for each Gaussian at each pixel."""


def brute(objects: list[Placed], intrinsics: Intrinsics, width: int, height: int) -> Image:
    """The image, without tiles: each of them has all Gaussians, and each Gaussian all pixels.

    By one thread; projection and order are the renderer's, a small part of the time.
    """
    with Renderer(1, NOTHING) as renderer:
        image = renderer.draw(objects, intrinsics, width, height)
        counts, begins = renderer._runs.counts, renderer._runs.table[:, 3]
        z, shape, box, paint = renderer._places
        sums, is_open = renderer._pixels
    across, tiles = -(-width // TILE), len(sums)
    is_due = np.ones(tiles, np.bool_)
    box[:] = (0, across * TILE, 0, tiles // across * TILE)
    places, keys = np.empty(counts.sum(), np.int32), np.empty(counts.sum())
    whole = (-np.inf, np.inf)
    listing.gathered(begins, counts, z, box, whole, across, is_due, places, keys)
    places = listing.sorted_places(places, keys)
    starts = np.array((0, len(places)))
    blend.clear(is_due, sums, is_open, 0, tiles)
    is_open_tile = is_due.copy()
    for tile in range(tiles):
        to = (shape, box, paint, tile, tile + 1, across, False, True, sums, is_open)
        blend.blend(starts, places, is_open_tile, *to)
    blend.put(across, is_due, sums, *image, 0, tiles)
    return image


def measure(rounds: int) -> list[dict[str, Any]]:
    """How many times as long every Gaussian takes at every pixel."""
    rows = []
    for count, size in BESIDE:
        shot = scenes.front(count, size)
        whole = partial(brute, shot.placed(), shot.views[0].intrinsics, *size)
        whole()  # compiles
        floor, taken = _shared.processor_ms(whole), drawn.cost(shot, EXACT, rounds)[1]
        found = {
            "gaussians": count,
            "size": "{}x{}".format(*size),
            "ms": round(taken, 2),
            "brute_ms": round(floor, 1),
            "ratio": round(floor / taken, 1),
        }
        rows.append(_shared.told(found))
    return rows
