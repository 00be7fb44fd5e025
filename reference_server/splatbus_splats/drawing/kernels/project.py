"""Where Gaussians are on the image, how large, and of what colour.

In float64: it is a small part of the time, and float32 would lose needles, ties in depth and what
is far from the origin.

The inverse of a covariance with the entries a, b; b, c is used in the form

    q = U² + V²,  U = √(c/det)·(dx − b/c·dy),  V = dy/√c

whose two terms do not cancel, however long and thin the ellipse.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from splatbus_splats.drawing import definition, harmonics
from splatbus_splats.drawing.kernels.compiled import (
    ACROSS,
    ALONG,
    BLUE,
    BOTTOM,
    DOWN,
    GREEN,
    INVERSE,
    LEFT,
    NOTHING,
    OPACITY,
    RED,
    RIGHT,
    TOP,
    U,
    V,
    compiled,
)

SLACK = 1e-3
"""Pixels by which boxes are larger than they need be, for what rounding does."""
LOW_PASS, LEAST_OPACITY = definition.LOW_PASS, definition.LEAST_ALPHA
_values = compiled(harmonics.values)


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
    skips: Any,
    runs: Any,
    counts: Any,
    z_of: Any,
    shape_of: Any,
    box_of: Any,
    paint_of: Any,
) -> None:
    """Those Gaussians of some runs that may be seen.

    Args:
        means: as all that follows, of `Gaussians`. By themselves: in a tuple of arrays, Numba 0.60
            takes one layout for another.
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
        skips: whether what is outside and what is small is; then, how many harmonics a channel
            has: 0 where no colour is wanted.
        runs: (R, 4) int64: which it is, its first Gaussian, the one after its last, and the place
            from which on there is room for it.
        counts: of all runs: how many of each were found is written there.
        z_of: (M,) float64, depths.
        shape_of: (M, 5) float64.
        box_of: (M, 4) int32.
        paint_of: (M, 5) float32.
    """
    fx, fy, cx, cy = lens
    near, far = depths
    width, height = size
    skips_outside, skips_small, bands = skips
    s = math.sqrt(turn[0, 0] * turn[0, 0] + turn[0, 1] * turn[0, 1] + turn[0, 2] * turn[0, 2])
    for run, first, last, start in runs:
        place = start
        for i in range(first, last):
            ox = np.float64(means[i, 0]) - eye[0]
            oy = np.float64(means[i, 1]) - eye[1]
            oz = np.float64(means[i, 2]) - eye[2]
            z = turn[2, 0] * ox + turn[2, 1] * oy + turn[2, 2] * oz
            opacity = np.float64(opacities[i])
            if not (z > near and z <= far) or opacity < LEAST_OPACITY:
                continue
            reach = 2.0 * math.log(opacity / LEAST_OPACITY)
            x = (turn[0, 0] * ox + turn[0, 1] * oy + turn[0, 2] * oz) / z
            y = (turn[1, 0] * ox + turn[1, 1] * oy + turn[1, 2] * oz) / z
            u, v = fx * x + cx, fy * y + cy
            x, y = min(max(x, slopes[0]), slopes[1]), min(max(y, slopes[2]), slopes[3])
            if skips_outside:
                # The rows of the Jacobian are no longer than this, and no axis than the largest.
                longest = s * max(scales[i, 0], scales[i, 1], scales[i, 2]) / z
                fxx, fyy = fx * fx * (1.0 + x * x), fy * fy * (1.0 + y * y)
                wide = SLACK + math.sqrt(reach * (fxx * longest * longest + LOW_PASS))
                high = SLACK + math.sqrt(reach * (fyy * longest * longest + LOW_PASS))
                if u + wide < 0.0 or u - wide > width or v + high < 0.0 or v - high > height:
                    continue
            R, J = _matrix(rotations, i), (fx / z, fy / z, x, y)
            r0, s0 = _column(turn, R[0], J, scales[i, 0])
            r1, s1 = _column(turn, R[1], J, scales[i, 1])
            r2, s2 = _column(turn, R[2], J, scales[i, 2])
            rr = r0 * r0 + r1 * r1 + r2 * r2
            ss = s0 * s0 + s1 * s1 + s2 * s2
            rs = r0 * s0 + r1 * s1 + r2 * s2
            p0, p1, p2 = r1 * s2 - r2 * s1, r2 * s0 - r0 * s2, r0 * s1 - r1 * s0
            area = p0 * p0 + p1 * p1 + p2 * p2
            det = area + LOW_PASS * (rr + ss) + LOW_PASS * LOW_PASS
            if skips_small and opacity * math.sqrt(area / det) < LEAST_OPACITY:
                continue
            a, c = rr + LOW_PASS, ss + LOW_PASS
            wide, high = math.sqrt(reach * a) + SLACK, math.sqrt(reach * c) + SLACK
            left = min(max(u - wide - 0.5, -1.0), np.float64(width))
            right = min(max(u + wide - 0.5, -2.0), np.float64(width))
            top = min(max(v - high - 0.5, -1.0), np.float64(height))
            bottom = min(max(v + high - 0.5, -2.0), np.float64(height))
            x0, x1 = max(math.ceil(left), 0), min(math.floor(right) + 1, width)
            y0, y1 = max(math.ceil(top), 0), min(math.floor(bottom) + 1, height)
            if skips_outside and (x0 >= x1 or y0 >= y1):
                continue
            z_of[place] = z
            shape_of[place, U], shape_of[place, V] = u, v
            across = math.sqrt(c / det)
            shape_of[place, ACROSS], shape_of[place, ALONG] = across, -across * rs / c
            shape_of[place, DOWN] = 1.0 / math.sqrt(c)
            box_of[place, LEFT], box_of[place, RIGHT] = x0, max(x0, x1)
            box_of[place, TOP], box_of[place, BOTTOM] = y0, max(y0, y1)
            _shade(coefficients, i, bands, ox, oy, oz, paint_of, place)
            paint_of[place, OPACITY] = opacities[i]
            paint_of[place, INVERSE] = 1.0 / z
            place += 1
        counts[run] = place - start


@compiled
def _matrix(rotations: Any, i: int) -> Any:
    """The rotation of a quaternion, which is made unit in float64, by columns."""
    x, y = np.float64(rotations[i, 0]), np.float64(rotations[i, 1])
    z, w = np.float64(rotations[i, 2]), np.float64(rotations[i, 3])
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return (
        (1.0 - s * (y * y + z * z), s * (x * y + z * w), s * (x * z - y * w)),
        (s * (x * y - z * w), 1.0 - s * (x * x + z * z), s * (y * z + x * w)),
        (s * (x * z + y * w), s * (y * z - x * w), 1.0 - s * (x * x + y * y)),
    )


@compiled
def _column(turn: Any, axis: Any, J: Any, scale: Any) -> Any:
    """Of A = J·W·R·S, whose covariance is A·Aᵀ; J is of focal lengths over z, and slopes."""
    fx, fy, x, y = J
    first = turn[0, 0] * axis[0] + turn[0, 1] * axis[1] + turn[0, 2] * axis[2]
    second = turn[1, 0] * axis[0] + turn[1, 1] * axis[1] + turn[1, 2] * axis[2]
    third = turn[2, 0] * axis[0] + turn[2, 1] * axis[1] + turn[2, 2] * axis[2]
    return fx * (first - x * third) * scale, fy * (second - y * third) * scale


@compiled
def _shade(
    coefficients: Any, i: int, count: int, ox: Any, oy: Any, oz: Any, paint_of: Any, place: int
) -> None:
    """The colour along (ox, oy, oz), of `count` harmonics a channel; black if that is 0."""
    norm = math.sqrt(ox * ox + oy * oy + oz * oz)
    Y = _values(ox / norm, oy / norm, oz / norm)
    half = np.float32(0.5 if count else 0.0)
    red, green, blue = half, half, half
    for k in range(count):
        weight = np.float32(Y[k])
        red += weight * coefficients[i, k, 0]
        green += weight * coefficients[i, k, 1]
        blue += weight * coefficients[i, k, 2]
    paint_of[place, RED] = max(red, NOTHING)
    paint_of[place, GREEN] = max(green, NOTHING)
    paint_of[place, BLUE] = max(blue, NOTHING)
