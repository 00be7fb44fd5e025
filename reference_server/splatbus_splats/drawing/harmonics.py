"""Colour that depends on the direction of sight: real spherical harmonics as 3DGS stores them.

Up to degree 3, 16 coefficients a channel; colour is 0.5 + Σ kᵢ·Yᵢ(d), where d is the unit vector
from the camera to the Gaussian in the axes in which the coefficients were fitted.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]

CONSTANT = 0.28209479177387814
"""Y of degree 0."""
BANDS = (slice(0, 1), slice(1, 4), slice(4, 9), slice(9, 16))
"""Which coefficients belong to each degree."""


def basis(directions: Floats) -> Floats:
    """(16, N) values of the basis at (N, 3) unit vectors, in their precision."""
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    values = (
        CONSTANT * np.ones_like(x),
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2 * zz - xx - yy),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (xx - yy),
        -0.5900435899266435 * y * (3 * xx - yy),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4 * zz - xx - yy),
        0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
        -0.4570457994644658 * x * (4 * zz - xx - yy),
        1.445305721320277 * z * (xx - yy),
        -0.5900435899266435 * x * (xx - 3 * yy),
    )
    return np.stack(values).astype(directions.dtype)


def colours(coefficients: Floats, offsets: Floats) -> Floats:
    """(N, 3) colours, 0 or more, of Gaussians seen along `offsets`, which need not be unit vectors.

    Args:
        coefficients: (up to 16, 3, N).
        offsets: (N, 3), from the camera to each Gaussian, in the coefficients' axes.
    """
    directions = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    Y = basis(directions.astype(coefficients.dtype))[: len(coefficients)]
    seen = np.einsum("kn,kcn->nc", Y, coefficients) + coefficients.dtype.type(0.5)
    return np.asarray(np.maximum(seen, 0))


def spread_directions(count: int) -> Floats:
    """(count, 3) unit vectors, evenly over the sphere (a Fibonacci lattice)."""
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    turn = i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack((r * np.cos(turn), r * np.sin(turn), z), axis=1)
