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


def values(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """The 16 values of the basis at a unit vector, or at many: also what loops are compiled of."""
    xx, yy, zz = x * x, y * y, z * z
    return (
        CONSTANT + 0.0 * x,
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2.0 * zz - xx - yy),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (xx - yy),
        -0.5900435899266435 * y * (3.0 * xx - yy),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4.0 * zz - xx - yy),
        0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.4570457994644658 * x * (4.0 * zz - xx - yy),
        1.445305721320277 * z * (xx - yy),
        -0.5900435899266435 * x * (xx - 3.0 * yy),
    )


def colours(coefficients: Floats, offsets: Floats) -> Floats:
    """(N, 3) colours, 0 or more, of Gaussians seen along `offsets`, which need not be unit vectors.

    Args:
        coefficients: (up to 16, 3, N).
        offsets: (N, 3), from the camera to each Gaussian, in the coefficients' axes.
    """
    directions = offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    Y = np.stack(values(*directions.T)[: len(coefficients)])
    return np.asarray(np.maximum(np.einsum("kn,kcn->nc", Y, coefficients) + 0.5, 0.0))
