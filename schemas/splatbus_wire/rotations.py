"""Quaternions as they arrive, and the rotation matrices that they mean.

A quaternion is (x, y, z, w), Hamilton, scalar last [CNV-3]; a 3×3 matrix is a flat tuple of nine
floats in row-major order. Plain Python floats, because one pose at a time is what arrives, and
NumPy costs more for nine numbers than the arithmetic does.
"""

from __future__ import annotations

import math

import numpy as np
from splatbus_schemas import LIMITS

from splatbus_wire.errors import ProtocolError

Quaternion = tuple[float, float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]

NORM_TOLERANCE: float = LIMITS["rotation_norm_tolerance"]
# Matrices exported in single precision are off by 1e-6, one with a flipped axis by 2.
ORTHOGONALITY_TOLERANCE = 1e-3


def check_quaternion(q: Quaternion, *, pointer: str | None = None) -> None:
    """Refuse a quaternion that is not finite or whose norm is not within 0.01 of 1 [POS-3].

    Args:
        q: (x, y, z, w) as it arrived.
        pointer: JSON pointer to the rotation in its message, for the error.

    Raises:
        ProtocolError: `invalid_rotation`, requirement POS-3.
    """
    norm = math.hypot(*q)
    # A NaN fails this comparison too.
    if 1.0 - NORM_TOLERANCE <= norm <= 1.0 + NORM_TOLERANCE:
        return
    raise ProtocolError(
        "invalid_rotation",
        f"the rotation {q!r} has norm {norm!r}, which is not within {NORM_TOLERANCE} of 1",
        requirement="POS-3",
        pointer=pointer,
    )


def rotation_matrix(q: Quaternion) -> Matrix3:
    """Return the rotation of q/‖q‖ as a flat row-major 3×3 matrix, each entry within 8u [ACC-2].

    The diagonal 1 − s(y² + z²), s = 2/‖q‖², is written s/2·(w² + x² − y² − z²), and ‖q‖² is summed
    without rounding in between. Done in the plain order, a search for bad cases finds 9.0u an
    entry, 19.7u in RᵀR − I and 11.4u in −Rᵀ·c near half-turns; this way 4.8u, 10.1u and 7.2u.

    Args:
        q: (x, y, z, w), not zero; see `check_quaternion`.
    """
    x, y, z, w = q
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    s = 2.0 / math.fsum((xx, yy, zz, ww))
    h = 0.5 * s
    xy, xz, yz = x * y, x * z, y * z
    xw, yw, zw = x * w, y * w, z * w
    return (
        h * ((ww + xx) - (yy + zz)),
        s * (xy - zw),
        s * (xz + yw),
        s * (xy + zw),
        h * ((ww + yy) - (xx + zz)),
        s * (yz - xw),
        s * (xz - yw),
        s * (yz + xw),
        h * ((ww + zz) - (xx + yy)),
    )


def quaternion_from_matrix(R: Matrix3) -> Quaternion:
    """Return the unit quaternion (x, y, z, w) of a rotation matrix, its largest component positive.

    The four products 4·q·qᵢ of the quaternion with its own components are linear in R; the one of
    the largest component loses no digits (S. W. Shepperd, "Quaternion from rotation matrix", 1978).

    Args:
        R: flat row-major 3×3 matrix, orthogonal to 1e-3 and of determinant +1.

    Raises:
        ValueError: R is no rotation; a reflection has no quaternion.
    """
    _check_rotation(R)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = R
    squares = (
        1.0 + (r00 - r11 - r22),
        1.0 + (r11 - r00 - r22),
        1.0 + (r22 - r00 - r11),
        1.0 + (r00 + r11 + r22),
    )
    x, y, z, w = (
        (squares[0], r10 + r01, r02 + r20, r21 - r12),
        (r10 + r01, squares[1], r21 + r12, r02 - r20),
        (r02 + r20, r21 + r12, squares[2], r10 - r01),
        (r21 - r12, r02 - r20, r10 - r01, squares[3]),
    )[squares.index(max(squares))]
    norm = math.hypot(x, y, z, w)
    return x / norm, y / norm, z / norm, w / norm


def _check_rotation(R: Matrix3) -> None:
    matrix = np.array(R).reshape(3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(matrix.T @ matrix - np.eye(3)).max()
    if not deviation <= ORTHOGONALITY_TOLERANCE:
        raise ValueError(f"{R!r} is not orthogonal: RᵀR differs from I by {deviation:.3g}")
    if np.linalg.det(matrix) < 0.0:
        raise ValueError(f"{R!r} is a reflection (determinant −1), which no quaternion expresses")
