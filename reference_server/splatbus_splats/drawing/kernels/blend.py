"""Pixels, in float32: tiles of 16×16, in blocks of 4×4 that a processor's vectors hold."""

from __future__ import annotations

from typing import Any

import numpy as np

from splatbus_splats.drawing.kernels.compiled import (
    ACROSS,
    ALONG,
    BLOCK,
    BLUE,
    BOTTOM,
    DOWN,
    GREEN,
    INVERSE,
    LARGEST_ALPHA,
    LEAST_ALPHA,
    LEAST_LEFT,
    LEFT,
    NOTHING,
    ONE,
    OPACITY,
    RED,
    RIGHT,
    TILE,
    TOP,
    U,
    V,
    compiled,
)

LOOK = 8
"""After how many Gaussians a tile is looked at for which of its blocks are unfinished."""
WIDE = TILE // BLOCK
BLOCKS, PIXELS = WIDE * WIDE, BLOCK * BLOCK
SUMS = 6
"""Of a pixel: what is left of its light, red, green, blue, alpha, inverse depth."""
ROUNDER = np.float32(1.5 * 2.0**23)
"""Added to a small number, it leaves the nearest integer in the last bits."""


@compiled
def _bell(q: Any) -> Any:
    """exp(−q/2) for q ≥ 0, to 2e-7: 2ⁿ by its bits, times a polynomial of the rest."""
    power = q * np.float32(-0.72134752044448170)
    power = power if power > np.float32(-126.0) else np.float32(-126.0)
    whole = power + ROUNDER
    t = power - (whole - ROUNDER)
    # 2^t for |t| ≤ 1/2, the least relative error at Chebyshev's points: 8e-8.
    value = np.float32(0.00132669704)
    value = value * t + np.float32(0.00967545975)
    value = value * t + np.float32(0.0555074262)
    value = value * t + np.float32(0.240221218)
    value = value * t + np.float32(0.693146949)
    value = value * t + np.float32(1.00000007)
    bits = (np.float32(whole).view(np.int32) << np.int32(23)) + np.float32(value).view(np.int32)
    return np.int32(bits).view(np.float32)


@compiled
def blend(
    starts: Any,
    lists: Any,
    is_due: Any,
    shape_of: Any,
    box_of: Any,
    paint_of: Any,
    begin: int,
    end: int,
    across: int,
    looks: bool,
    adds_inverse: bool,
    sums_of: Any,
    is_open_of: Any,
) -> None:
    """Draws over what is there in the tiles that are due, from one until before another.

    Args:
        starts: where the list of each tile from `begin` on is in `lists`.
        lists: places, near ones first.
        is_due: of all tiles; those that are finished are no longer.
        shape_of: of places, as all that follows; see `compiled`.
        box_of: …
        paint_of: …
        begin: of the tiles.
        end: …
        across: tiles in a row.
        looks: whether blocks in which all is opaque are finished, not only whole tiles in the end.
        adds_inverse: whether depth is wanted.
        sums_of: (tiles, blocks, `SUMS`, pixels) float32.
        is_open_of: (tiles, blocks).
    """
    for tile in range(begin, end):
        if not is_due[tile]:
            continue
        X, Y = (tile % across) * TILE, (tile // across) * TILE
        sums, is_open = sums_of[tile].reshape(-1), is_open_of[tile]
        for place in range(starts[tile - begin], starts[tile - begin + 1]):
            k = lists[place]
            du, dv = X + 0.5 - shape_of[k, U], Y + 0.5 - shape_of[k, V]
            step, tall, drop = shape_of[k, ACROSS], shape_of[k, ALONG], shape_of[k, DOWN]
            step_, tall_, drop_ = np.float32(step), np.float32(tall), np.float32(drop)
            red, green, blue = paint_of[k, RED], paint_of[k, GREEN], paint_of[k, BLUE]
            opacity, near = paint_of[k, OPACITY], paint_of[k, INVERSE]
            first_column = max(box_of[k, LEFT] - X, 0) // BLOCK
            last_column = (min(box_of[k, RIGHT] - X, TILE) + BLOCK - 1) // BLOCK
            first_row = max(box_of[k, TOP] - Y, 0) // BLOCK
            last_row = (min(box_of[k, BOTTOM] - Y, TILE) + BLOCK - 1) // BLOCK
            for row in range(first_row, last_row):
                # In float64 up to a block's corner: the centre may be far from the image.
                dy = BLOCK * row + dv
                line, down = step * du + tall * dy, np.float32(drop * dy)
                for column in range(first_column, last_column):
                    block = row * WIDE + column
                    if not is_open[block]:
                        continue
                    corner = np.float32(line + step * (BLOCK * column))
                    # Unsigned, and in one array: so the compiler sees that nothing overlaps.
                    base = np.uint64(block) * np.uint64(SUMS * PIXELS)
                    for pixel in range(PIXELS):
                        x = np.float32(np.int32(pixel % BLOCK))
                        y = np.float32(np.int32(pixel // BLOCK))
                        off = corner + (step_ * x + tall_ * y)
                        below = down + drop_ * y
                        alpha = opacity * _bell(off * off + below * below)
                        alpha = alpha if alpha < LARGEST_ALPHA else LARGEST_ALPHA
                        alpha = alpha if alpha >= LEAST_ALPHA else NOTHING
                        i = base + np.uint64(pixel)
                        before = sums[i]
                        after = before * (ONE - alpha)
                        goes_on = after >= LEAST_LEFT
                        weight = before * alpha if goes_on else NOTHING
                        sums[i] = after if goes_on else NOTHING
                        sums[i + np.uint64(PIXELS)] += weight * red
                        sums[i + np.uint64(2 * PIXELS)] += weight * green
                        sums[i + np.uint64(3 * PIXELS)] += weight * blue
                        sums[i + np.uint64(4 * PIXELS)] += weight
                        if adds_inverse:
                            sums[i + np.uint64(5 * PIXELS)] += weight * near
            if looks and place % LOOK == 0 and not _look(sums, is_open):
                break
        is_due[tile] = _look(sums, is_open)


@compiled
def clear(is_due: Any, sums_of: Any, is_open_of: Any, begin: int, end: int) -> None:
    """Tiles that are due, before anything is in them."""
    for tile in range(begin, end):
        if is_due[tile]:
            sums_of[tile] = NOTHING
            sums_of[tile, :, 0] = ONE
            is_open_of[tile] = True


@compiled
def put(
    across: int, is_due: Any, sums_of: Any, color: Any, inverse: Any, begin: int, end: int
) -> None:
    """Tiles that are due, into the images."""
    height, width = inverse.shape
    for tile in range(begin, end):
        if is_due[tile]:
            X, Y = (tile % across) * TILE, (tile // across) * TILE
            for y in range(min(TILE, height - Y)):
                for x in range(min(TILE, width - X)):
                    block, pixel = y // BLOCK * WIDE + x // BLOCK, y % BLOCK * BLOCK + x % BLOCK
                    for channel in range(4):
                        color[Y + y, X + x, channel] = sums_of[tile, block, channel + 1, pixel]
                    inverse[Y + y, X + x] = sums_of[tile, block, 5, pixel]


@compiled
def _look(sums: Any, is_open: Any) -> bool:
    """Which blocks have a pixel with light left; whether there is one."""
    bits = sums.view(np.int32)  # in the order of the values, which are 0 or more
    is_any = False
    for block in range(BLOCKS):
        if is_open[block]:
            most = np.int32(0)
            base = np.uint64(block) * np.uint64(SUMS * PIXELS)
            for pixel in range(PIXELS):
                most = max(most, bits[base + np.uint64(pixel)])
            is_open[block] = most > 0
            is_any = is_any or is_open[block]
    return is_any


@compiled
def spread(coarse: Any, fine: Any, first: int, last: int) -> None:
    """Rows of an image of twice the size, linear between the pixels of a coarse one.

    Args:
        coarse: (h, w, C) float32.
        fine: (H, W, C) float32, of 2h or 2h − 1 rows, and columns likewise.
        first: row.
        last: the row after the last.
    """
    height, width, channels = coarse.shape
    row = np.empty((width + 2) * channels, np.float32)  # with a column more on either side
    quarter = np.float32(0.25)
    for y in range(first, last):
        # A coarse pixel's centre is a quarter of its width away from those of four fine ones.
        near = coarse[y // 2].reshape(-1)
        other = coarse[min(max(y // 2 + (1 if y % 2 else -1), 0), height - 1)].reshape(-1)
        for i in range(width * channels):
            row[i + channels] = near[i] + quarter * (other[i] - near[i])
        row[:channels] = row[channels : 2 * channels]
        row[(width + 1) * channels :] = row[width * channels : (width + 1) * channels]
        for x in range(fine.shape[1]):
            at = (x // 2 + 1) * channels
            beside = at + (channels if x % 2 else -channels)
            for channel in range(channels):
                value = row[at + channel]
                fine[y, x, channel] = value + quarter * (row[beside + channel] - value)
