"""In which order Gaussians are drawn, and in which tiles they are."""

from __future__ import annotations

from typing import Any

import numpy as np

from splatbus_splats.drawing.kernels.compiled import BOTTOM, LEFT, RIGHT, TILE, TOP, compiled

BITS = 11
"""Of a key, by which it is sorted at a time."""
TIMES = -(-64 // BITS)


@compiled
def gathered(
    begins: Any,
    counts: Any,
    z_of: Any,
    box_of: Any,
    span: Any,
    across: int,
    is_due: Any,
    places: Any,
    depths: Any,
) -> int:
    """The places of some runs, and their depths, that are in a tile that is due; how many.

    Args:
        begins: (R,), where each run is.
        counts: (R,), how many of it may be seen.
        z_of: (M,) float64, depths.
        box_of: (M, 4) int32.
        span: from which depth on, and before which.
        across: tiles in a row.
        is_due: of each tile.
        places: (N,) int32, to write.
        depths: (N,) float64, to write.
    """
    least, most = span
    found = 0
    for run in range(len(begins)):
        for k in range(begins[run], begins[run] + counts[run]):
            if least <= z_of[k] < most and _is_in(box_of, k, across, is_due):
                places[found], depths[found] = k, z_of[k]
                found += 1
    return found


@compiled
def _is_in(box_of: Any, k: int, across: int, is_due: Any) -> bool:
    for row in range(box_of[k, TOP] // TILE, (box_of[k, BOTTOM] - 1) // TILE + 1):
        for column in range(box_of[k, LEFT] // TILE, (box_of[k, RIGHT] - 1) // TILE + 1):
            if is_due[row * across + column]:
                return True
    return False


@compiled
def sorted_places(places: Any, depths: Any) -> Any:
    """The places by depth, near ones first, equal ones as they came: a radix sort.

    Args:
        places: (N,) int32; what it holds is lost.
        depths: (N,) float64, positive: their bits are in the order of their values. Lost as well.
    """
    keys = depths.view(np.uint64)
    other_places, other_keys = np.empty_like(places), np.empty_like(keys)
    counts = np.zeros((TIMES, 1 << BITS), np.int64)
    mask = np.uint64((1 << BITS) - 1)
    for key in keys:
        for time in range(TIMES):
            counts[time, (key >> np.uint64(BITS * time)) & mask] += 1
    for time in range(TIMES):
        ends = counts[time]
        if len(keys) == 0 or ends[(keys[0] >> np.uint64(BITS * time)) & mask] == len(keys):
            continue  # they have these bits in common, as most of the exponent is
        total = 0
        for digit in range(1 << BITS):
            total, ends[digit] = total + ends[digit], total
        for i in range(len(keys)):
            digit = (keys[i] >> np.uint64(BITS * time)) & mask
            other_places[ends[digit]], other_keys[ends[digit]] = places[i], keys[i]
            ends[digit] += 1
        places, other_places = other_places, places
        keys, other_keys = other_keys, keys
    return places


@compiled
def in_tiles(places: Any, box_of: Any, tiles_of: Any) -> None:
    """The boxes of some places, in their order, in tiles: (N, 4) int16.

    Without a loop inside, so that the processor waits for many of them at a time.
    """
    for i in range(len(places)):
        k = places[i]
        tiles_of[i, LEFT] = box_of[k, LEFT] // TILE
        tiles_of[i, RIGHT] = (box_of[k, RIGHT] - 1) // TILE + 1
        tiles_of[i, TOP] = box_of[k, TOP] // TILE
        tiles_of[i, BOTTOM] = (box_of[k, BOTTOM] - 1) // TILE + 1


@compiled
def count_tiles(tiles_of: Any, across: int, is_due: Any, counts: Any) -> None:
    """Adds up how many boxes there are in each tile that is due, one place further on."""
    for i in range(len(tiles_of)):
        for row in range(tiles_of[i, TOP], tiles_of[i, BOTTOM]):
            for column in range(tiles_of[i, LEFT], tiles_of[i, RIGHT]):
                counts[row * across + column + 1] += is_due[row * across + column]


@compiled
def list_tiles(
    places: Any,
    tiles_of: Any,
    across: int,
    is_due: Any,
    first_row: int,
    last_row: int,
    ends: Any,
    lists: Any,
) -> None:
    """Lists who is in each due tile of some rows, in this order.

    `ends` goes from where the lists of these tiles begin to their ends.
    """
    first = first_row * across
    for i in range(len(places)):
        for row in range(max(tiles_of[i, TOP], first_row), min(tiles_of[i, BOTTOM], last_row)):
            for column in range(tiles_of[i, LEFT], tiles_of[i, RIGHT]):
                tile = row * across + column
                if is_due[tile]:
                    lists[ends[tile - first]] = places[i]
                    ends[tile - first] += 1
