"""The picture by its definition, in float64: every Gaussian at every pixel, one after the other.

It is what renderers are compared with, and is slow: some microseconds a Gaussian, and a few
nanoseconds for each pixel of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_server.view import Intrinsics

from splatbus_splats.drawing import harmonics
from splatbus_splats.drawing.definition import (
    LARGEST_ALPHA,
    LEAST_ALPHA,
    LEAST_LEFT,
    LOW_PASS,
    Image,
    Placed,
    depths,
    slopes,
)
from splatbus_splats.gaussians import Gaussians

Floats = NDArray[np.float64]

FAR = 12.0
"""From this q on, no opacity up to 1 leaves an alpha that counts: it would be 0.0025."""


class _Flat(NamedTuple):
    """Gaussians on the image, in pixels."""

    z: Floats
    centers: Floats  # (N, 2)
    conics: Floats  # (N, 3): q = a·dx² + 2b·dx·dy + c·dy²
    opacities: Floats
    colors: Floats  # (N, 3)


def truth(objects: Sequence[Placed], intrinsics: Intrinsics, width: int, height: int) -> Image:
    """The whole image; (height, width, 4) and (height, width), float64."""
    rows, columns = np.divmod(np.arange(width * height), width)
    found = at_pixels(objects, intrinsics, width, height, columns, rows)
    return Image(found.color.reshape(height, width, 4), found.inverse.reshape(height, width))


def at_pixels(
    objects: Sequence[Placed],
    intrinsics: Intrinsics,
    width: int,
    height: int,
    columns: NDArray[Any],
    rows: NDArray[Any],
) -> Image:
    """Some pixels of the image; (P, 4) and (P,), float64.

    Args:
        objects: what is seen.
        intrinsics: in pixels.
        width: of the whole image, pixels.
        height: of the whole image, pixels.
        columns: (P,), of the pixels, 0 at the left.
        rows: (P,), of the pixels, 0 at the top.
    """
    parts = [_flat(each, intrinsics, width, height) for each in objects]
    if not parts:
        return Image(np.zeros((len(columns), 4)), np.zeros(len(columns)))
    flat = _Flat(*(np.concatenate(each) for each in zip(*parts)))
    u, v = columns + 0.5, rows + 0.5
    left, color, inverse = np.ones(len(u)), np.zeros((len(u), 4)), np.zeros(len(u))
    is_open = np.ones(len(u), np.bool_)
    for k in np.argsort(flat.z, kind="stable"):
        (x, y), (a, b, c) = flat.centers[k], flat.conics[k]
        dx, dy = u - x, v - y
        q = a * dx * dx + 2.0 * b * dx * dy + c * dy * dy
        at = np.flatnonzero(is_open & ~(q > FAR))  # elsewhere nothing changes
        if not len(at):
            continue
        alpha = np.minimum(LARGEST_ALPHA, flat.opacities[k] * np.exp(-0.5 * q[at]))
        alpha[alpha < LEAST_ALPHA] = 0.0
        after = left[at] * (1.0 - alpha)
        is_open[at] = goes_on = after >= LEAST_LEFT
        weight = np.where(goes_on, left[at] * alpha, 0.0)
        color[at] += weight[:, None] * (*flat.colors[k], 1.0)
        inverse[at] += weight / flat.z[k]
        left[at] = np.where(goes_on, after, left[at])
    return Image(color, inverse)


def _flat(placed: Placed, intrinsics: Intrinsics, width: int, height: int) -> _Flat:
    """The Gaussians whose centres are before the camera, projected.

    The covariance is A·Aᵀ + 0.3·I with the rows r, s of A = J·W·R·S. Its determinant is written
    |r × s|² + 0.3(|r|² + |s|²) + 0.09 (Cauchy-Binet), a sum of squares: the plain difference of two
    products loses all its digits where a needle is 10⁸ pixels long.
    """
    fx, fy, cx, cy = intrinsics[:4]
    near, far = depths(intrinsics)
    g = placed.gaussians
    offsets = g.means.astype(np.float64) - placed.eye
    z = offsets @ placed.turn[2]
    is_seen = (z > near) & (z <= far)
    offsets, z = offsets[is_seen], z[is_seen]
    x, y, _ = placed.turn @ offsets.T
    axes = _matrices(g.rotations[is_seen].astype(np.float64)) * g.scales[is_seen, None, :]
    J = np.zeros((len(z), 2, 3))
    J[:, 0, 0], J[:, 1, 1] = fx / z, fy / z
    J[:, 0, 2] = -fx * np.clip(x / z, *slopes(fx, cx, width)) / z
    J[:, 1, 2] = -fy * np.clip(y / z, *slopes(fy, cy, height)) / z
    A = J @ placed.turn @ axes
    r, s = A[:, 0], A[:, 1]
    rr, rs, ss = (r * r).sum(axis=1), (r * s).sum(axis=1), (s * s).sum(axis=1)
    areas = np.square(np.cross(r, s)).sum(axis=1)
    determinants = areas + LOW_PASS * (rr + ss) + LOW_PASS**2
    conics = np.stack((ss + LOW_PASS, -rs, rr + LOW_PASS), axis=1) / determinants[:, None]
    centers = np.stack((fx * x / z + cx, fy * y / z + cy), axis=1)
    opacities = g.opacities[is_seen].astype(np.float64)
    return _Flat(z, centers, conics, opacities, _colors(g, is_seen, offsets))


def _colors(g: Gaussians, is_seen: NDArray[np.bool_], offsets: Floats) -> Floats:
    if not len(offsets):
        return np.empty((0, 3))
    coefficients = g.coefficients[is_seen].astype(np.float64).transpose(1, 2, 0)
    return harmonics.colours(coefficients, offsets)


def _matrices(q: Floats) -> Floats:
    """(N, 3, 3) rotations of (N, 4) quaternions x, y, z, w, which are made unit."""
    x, y, z, w = q.T / np.linalg.norm(q, axis=1)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.array(rows).transpose(2, 0, 1)
