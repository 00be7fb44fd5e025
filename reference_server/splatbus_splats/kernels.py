"""The renderer's loops, compiled by Numba when they are first called, and kept where it may.

Projection is in float64: it is a small part of the time, and float32 would lose needles, ties in
depth and what is far from the origin. Pixels are in float32.

The inverse of a covariance with the entries a, b; b, c is used in the form

    q = U² + V²,  U = √(c/det)·(dx − b/c·dy),  V = dy/√c

whose two terms do not cancel, however long and thin the ellipse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from splatbus_splats import definition

Function = TypeVar("Function", bound=Callable[..., Any])

TILE = 16
"""Pixels, the width and height of a tile."""
U, V, ACROSS, ALONG, DOWN = range(5)
"""Of a Gaussian's shape: its centre, pixels, and what U and V take of dx and dy."""
RED, GREEN, BLUE, OPACITY, INVERSE = range(5)
"""Of its paint."""
SLACK = 1e-3
"""Pixels by which boxes are larger than they need be, for what rounding does."""
LOW_PASS, NOTHING = definition.LOW_PASS, np.float32(0.0)
LEAST_LEFT, ONE = np.float32(definition.LEAST_LEFT), np.float32(1.0)
LARGEST_ALPHA, LEAST_ALPHA = np.float32(definition.LARGEST_ALPHA), np.float32(1.0 / 255.0)
LEAST_OPACITY = definition.LEAST_ALPHA
LOOK = 8
"""After how many Gaussians a tile is looked at for whether any of its pixels is unfinished."""


def compiled(function: Function) -> Function:
    """Compiled when it is called, without the interpreter's lock."""
    options = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    try:
        return cast(Function, numba.njit(cache=True, **options)(function))
    except RuntimeError:  # there is no folder that it may keep it in
        return cast(Function, numba.njit(**options)(function))


@compiled
def project(
    means: Any,
    rotations: Any,
    scales: Any,
    opacities: Any,
    coefficients: Any,
    turn: Any,
    eye: Any,
    lens: Any,
    slopes: Any,
    depths: Any,
    size: Any,
    start: int,
    z_of: Any,
    shape_of: Any,
    box_of: Any,
    paint_of: Any,
) -> int:
    """The Gaussians that may be seen, from the place `start` on; returns the place after them.

    Args:
        means: and what follows as in `Gaussians`.
        rotations: …
        scales: …
        opacities: …
        coefficients: …
        turn: (3, 3) as in `Placed`.
        eye: (3,) as in `Placed`.
        lens: fx, fy, cx, cy.
        slopes: least and largest x/z, then y/z.
        depths: a centre is drawn beyond the first and up to the second.
        size: width and height, pixels.
        start: where there is place.
        z_of: (M,) float64, depths.
        shape_of: (M, 5) float64.
        box_of: (M, 4) int32, pixels: first column, column after the last, and rows likewise.
        paint_of: (M, 5) float32.
    """
    fx, fy, cx, cy = lens
    near, far = depths
    width, height = size
    A = np.empty((2, 3))
    R = np.empty((3, 3))
    place = start
    for i in range(len(means)):
        ox = np.float64(means[i, 0]) - eye[0]
        oy = np.float64(means[i, 1]) - eye[1]
        oz = np.float64(means[i, 2]) - eye[2]
        z = turn[2, 0] * ox + turn[2, 1] * oy + turn[2, 2] * oz
        opacity = np.float64(opacities[i])
        if not (z > near and z <= far and opacity >= LEAST_OPACITY):
            continue
        x = (turn[0, 0] * ox + turn[0, 1] * oy + turn[0, 2] * oz) / z
        y = (turn[1, 0] * ox + turn[1, 1] * oy + turn[1, 2] * oz) / z
        u, v = fx * x + cx, fy * y + cy
        _matrix(rotations, i, R)
        _rows(turn, fx / z, fy / z, min(max(x, slopes[0]), slopes[1]),
              min(max(y, slopes[2]), slopes[3]), R, scales, i, A)  # fmt: skip
        rr = A[0, 0] * A[0, 0] + A[0, 1] * A[0, 1] + A[0, 2] * A[0, 2]
        ss = A[1, 0] * A[1, 0] + A[1, 1] * A[1, 1] + A[1, 2] * A[1, 2]
        rs = A[0, 0] * A[1, 0] + A[0, 1] * A[1, 1] + A[0, 2] * A[1, 2]
        p = A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]
        q = A[0, 2] * A[1, 0] - A[0, 0] * A[1, 2]
        r = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
        det = (p * p + q * q + r * r) + LOW_PASS * (rr + ss) + LOW_PASS * LOW_PASS
        a, c = rr + LOW_PASS, ss + LOW_PASS
        reach = 2.0 * math.log(opacity / LEAST_OPACITY)
        wide, high = math.sqrt(reach * a) + SLACK, math.sqrt(reach * c) + SLACK
        left = min(max(u - wide - 0.5, -1.0), np.float64(width))
        right = min(max(u + wide - 0.5, -2.0), np.float64(width))
        top = min(max(v - high - 0.5, -1.0), np.float64(height))
        bottom = min(max(v + high - 0.5, -2.0), np.float64(height))
        x0, x1 = max(math.ceil(left), 0), min(math.floor(right) + 1, width)
        y0, y1 = max(math.ceil(top), 0), min(math.floor(bottom) + 1, height)
        if x0 >= x1 or y0 >= y1:
            continue
        z_of[place] = z
        shape_of[place, U], shape_of[place, V] = u, v
        across = math.sqrt(c / det)
        shape_of[place, ACROSS], shape_of[place, ALONG] = across, -across * rs / c
        shape_of[place, DOWN] = 1.0 / math.sqrt(c)
        box_of[place, 0], box_of[place, 1] = x0, x1
        box_of[place, 2], box_of[place, 3] = y0, y1
        _shade(coefficients, i, ox, oy, oz, paint_of, place)
        paint_of[place, OPACITY] = opacities[i]
        paint_of[place, INVERSE] = 1.0 / z
        place += 1
    return place


@compiled
def _matrix(rotations: Any, i: int, R: Any) -> None:
    """The rotation of a quaternion, which is made unit in float64."""
    x, y = np.float64(rotations[i, 0]), np.float64(rotations[i, 1])
    z, w = np.float64(rotations[i, 2]), np.float64(rotations[i, 3])
    s = 2.0 / (x * x + y * y + z * z + w * w)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)
    R[1, 0], R[1, 1], R[1, 2] = s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)
    R[2, 0], R[2, 1], R[2, 2] = s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)


@compiled
def _rows(turn: Any, fx: Any, fy: Any, x: Any, y: Any, R: Any, scales: Any, i: int, A: Any) -> None:
    """A = J·W·R·S, whose covariance is A·Aᵀ; focal lengths are over z, and x, y slopes."""
    for k in range(3):
        first = turn[0, 0] * R[0, k] + turn[0, 1] * R[1, k] + turn[0, 2] * R[2, k]
        second = turn[1, 0] * R[0, k] + turn[1, 1] * R[1, k] + turn[1, 2] * R[2, k]
        third = turn[2, 0] * R[0, k] + turn[2, 1] * R[1, k] + turn[2, 2] * R[2, k]
        A[0, k] = fx * (first - x * third) * scales[i, k]
        A[1, k] = fy * (second - y * third) * scales[i, k]


@compiled
def _shade(coefficients: Any, i: int, ox: Any, oy: Any, oz: Any, paint_of: Any, place: int) -> None:
    """The colour along (ox, oy, oz); the basis is that of `harmonics`, where it is explained."""
    count = coefficients.shape[1]
    norm = math.sqrt(ox * ox + oy * oy + oz * oz)
    x, y, z = np.float32(ox / norm), np.float32(oy / norm), np.float32(oz / norm)
    xx, yy, zz = x * x, y * y, z * z
    for channel in range(3):
        k = coefficients[i, :, channel]
        seen = np.float32(0.5) + np.float32(0.28209479177387814) * k[0]
        if count > 1:
            seen += np.float32(0.4886025119029199) * (z * k[2] - y * k[1] - x * k[3])
        if count > 4:
            seen += np.float32(1.0925484305920792) * (x * y * k[4] - y * z * k[5] - x * z * k[7])
            seen += np.float32(0.31539156525252005) * (zz + zz - xx - yy) * k[6]
            seen += np.float32(0.5462742152960396) * (xx - yy) * k[8]
        if count > 9:
            three, four = np.float32(3.0), np.float32(4.0)
            seen -= np.float32(0.5900435899266435) * y * (three * xx - yy) * k[9]
            seen += np.float32(2.890611442640554) * x * y * z * k[10]
            seen -= np.float32(0.4570457994644658) * y * (four * zz - xx - yy) * k[11]
            inner = zz + zz - three * xx - three * yy
            seen += np.float32(0.3731763325901154) * z * inner * k[12]
            seen -= np.float32(0.4570457994644658) * x * (four * zz - xx - yy) * k[13]
            seen += np.float32(1.445305721320277) * z * (xx - yy) * k[14]
            seen -= np.float32(0.5900435899266435) * x * (xx - three * yy) * k[15]
        paint_of[place, channel] = max(seen, NOTHING)


@compiled
def count_tiles(box_of: Any, across: int, counts: Any) -> None:
    """Adds up how many boxes there are in each tile, in `counts` one place further on."""
    for k in range(len(box_of)):
        for row in range(box_of[k, 2] // TILE, (box_of[k, 3] - 1) // TILE + 1):
            for column in range(box_of[k, 0] // TILE, (box_of[k, 1] - 1) // TILE + 1):
                counts[row * across + column + 1] += 1


@compiled
def list_tiles(
    order: Any, box_of: Any, across: int, first: int, last: int, ends: Any, lists: Any
) -> None:
    """Lists who is in each tile of some rows, in this order.

    `first` and `last` are the tiles at the beginning of the rows and after them; `ends` goes from
    where the lists of these tiles begin to their ends.
    """
    first_row, last_row = first // across, last // across
    for k in order:
        top, bottom = box_of[k, 2] // TILE, (box_of[k, 3] - 1) // TILE + 1
        for row in range(max(top, first_row), min(bottom, last_row)):
            for column in range(box_of[k, 0] // TILE, (box_of[k, 1] - 1) // TILE + 1):
                tile = row * across + column - first
                lists[ends[tile]] = k
                ends[tile] += 1


@compiled
def _bell(q: Any) -> Any:
    """exp(−q/2) for q ≥ 0, to 2e-7: 2ⁿ by its bits, times a polynomial of the rest."""
    power = q * np.float32(-0.72134752044448170)
    power = power if power > np.float32(-126.0) else np.float32(-126.0)
    whole = math.floor(power)
    t = (power - np.float32(whole)) - np.float32(0.5)
    # 2^(t + 1/2) for |t| ≤ 1/2 by Chebyshev polynomials, to 6e-11.
    value = np.float32(2.16427011e-05)
    value = value * t + np.float32(0.000218775009)
    value = value * t + np.float32(0.00188563861)
    value = value * t + np.float32(0.0136019423)
    value = value * t + np.float32(0.0784946638)
    value = value * t + np.float32(0.339731592)
    value = value * t + np.float32(0.980258143)
    value = value * t + np.float32(1.41421356)
    bits = (np.int32(whole) + np.int32(127)) << np.int32(23)
    return value * np.int32(bits).view(np.float32)


@compiled
def blend(
    starts: Any,
    lists: Any,
    shape_of: Any,
    box_of: Any,
    paint_of: Any,
    first: int,
    last: int,
    across: int,
    color: Any,
    inverse: Any,
) -> None:
    """Draws the tiles from `first` until before `last` over whatever color and inverse hold."""
    height, width = inverse.shape
    sums = np.empty((5, TILE, TILE), np.float32)
    left = np.empty((TILE, TILE), np.float32)
    red, green, blue, alpha_sum, inverse_sum = sums
    for tile in range(first, last):
        X, Y = (tile % across) * TILE, (tile // across) * TILE
        sums[:] = NOTHING
        left[:] = ONE
        for place in range(starts[tile], starts[tile + 1]):
            k = lists[place]
            du, dv = X + 0.5 - shape_of[k, U], 0.5 - shape_of[k, V]
            step, tall = shape_of[k, ACROSS], shape_of[k, ALONG]
            r, g, b = paint_of[k, RED], paint_of[k, GREEN], paint_of[k, BLUE]
            opacity, near = paint_of[k, OPACITY], paint_of[k, INVERSE]
            slope = np.float32(step)
            for y in range(max(box_of[k, 2] - Y, 0), min(box_of[k, 3] - Y, TILE)):
                # In float64 up to here: the centre may be far from the image.
                dy = Y + y + dv
                begin = np.float32(step * du + tall * dy)
                down = np.float32(shape_of[k, DOWN] * dy)
                down = down * down
                for x in range(TILE):
                    off = begin + slope * np.float32(x)
                    alpha = opacity * _bell(off * off + down)
                    alpha = alpha if alpha < LARGEST_ALPHA else LARGEST_ALPHA
                    alpha = alpha if alpha >= LEAST_ALPHA else NOTHING
                    before = left[y, x]
                    after = before * (ONE - alpha)
                    is_open = after >= LEAST_LEFT
                    weight = before * alpha if is_open else NOTHING
                    left[y, x] = after if is_open else NOTHING
                    red[y, x] += weight * r
                    green[y, x] += weight * g
                    blue[y, x] += weight * b
                    alpha_sum[y, x] += weight
                    inverse_sum[y, x] += weight * near
            if place % LOOK == 0 and left.max() == NOTHING:
                break
        for y in range(min(TILE, height - Y)):
            for x in range(min(TILE, width - X)):
                for channel in range(4):
                    color[Y + y, X + x, channel] = sums[channel, y, x]
                inverse[Y + y, X + x] = inverse_sum[y, x]
