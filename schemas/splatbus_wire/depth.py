"""Depth of a surface from what a splatting rasteriser accumulates [ACC-8, ACC-9].

Which function, depends on what the renderer gives (`depth.estimator` of 1.1, section 3.4 there):

    d = Σ(1/zᵢ)·αᵢ·Tᵢ  `planar_depth`     A/d, the harmonic mean of the depths along the ray
    D = Σzᵢ·αᵢ·Tᵢ      `expected_depth`   D/A, their arithmetic mean
    z                  `surface_depth`    itself: the median, or a surface's own depth

All arrays are float32, and wider ones are refused: rounding them first would round twice.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS

COVERED_ALPHA_MIN = np.float32(LIMITS["covered_alpha_min"])

Float32Array = NDArray[np.float32]


def covered(depth: Float32Array, alpha: Float32Array | None = None) -> NDArray[np.bool_]:
    """Return where a surface is: A ≥ 1/255, what depth follows from > 0, both finite [ACC-9].

    Args:
        depth: d, D or z, float32, any shape.
        alpha: A = Σαᵢ·Tᵢ, float32, the same shape; None where the renderer gives none.
    """
    # No finite number is less than infinity, and no NaN is less than anything.
    with_depth = (depth > 0) & (depth < np.inf)
    if alpha is None:
        return with_depth
    return with_depth & (alpha >= COVERED_ALPHA_MIN) & (alpha < np.inf)


def planar_depth(
    inverse_depth: Float32Array,
    alpha: Float32Array | None = None,
    *,
    empty: float = np.inf,
    out: Float32Array | None = None,
) -> Float32Array:
    """Return the depth A/d, correctly rounded, where a surface is, else `empty` [ACC-8, BUF-7].

    The quotient of two float32 numbers is correctly rounded by the hardware, in one operation;
    where it overflows, the largest finite number stands in.

    Args:
        inverse_depth: d = Σ(1/zᵢ)·αᵢ·Tᵢ, float32, any shape.
        alpha: A = Σαᵢ·Tᵢ, float32, the same shape; None where the renderer gives none (A = 1).
        empty: depth of a pixel where no surface is, +∞ or 100.0.
        out: float32 array of the same shape to write to; not one of the others.

    Raises:
        TypeError: an input is not float32.
    """
    surface, depth = _prepared(inverse_depth, alpha, empty, out)
    numerator = np.float32(1) if alpha is None else alpha
    return _quotient(numerator, inverse_depth, surface, depth)


def expected_depth(
    accumulated_depth: Float32Array,
    alpha: Float32Array | None = None,
    *,
    empty: float = np.inf,
    out: Float32Array | None = None,
) -> Float32Array:
    """Return the depth D/A, correctly rounded, where a surface is, else `empty` [BUF-6, BUF-7].

    As `planar_depth`, but `accumulated_depth` is D = Σzᵢ·αᵢ·Tᵢ.
    """
    surface, depth = _prepared(accumulated_depth, alpha, empty, out)
    denominator = np.float32(1) if alpha is None else alpha
    return _quotient(accumulated_depth, denominator, surface, depth)


def surface_depth(
    z: Float32Array,
    alpha: Float32Array | None = None,
    *,
    empty: float = np.inf,
    out: Float32Array | None = None,
) -> Float32Array:
    """Return the depth z where a surface is, else `empty` [BUF-6, BUF-7].

    As `planar_depth`, but `z` is a planar depth already, as the median is.
    """
    surface, depth = _prepared(z, alpha, empty, out)
    np.copyto(depth, z, where=surface)
    return depth


def _prepared(
    given: Float32Array, alpha: Float32Array | None, empty: float, out: Float32Array | None
) -> tuple[NDArray[np.bool_], Float32Array]:
    """Where a surface is, and an image that is empty everywhere."""
    for array in (given, alpha):
        if array is not None and array.dtype != np.float32:
            raise TypeError(f"depth and alpha must be float32, not {array.dtype}")
    surface = covered(given, alpha)
    depth = np.empty_like(given) if out is None else out
    depth.fill(empty)
    return surface, depth


def _quotient(
    numerator: Float32Array | np.float32,
    denominator: Float32Array | np.float32,
    surface: NDArray[np.bool_],
    depth: Float32Array,
) -> Float32Array:
    with np.errstate(over="ignore"):
        np.divide(numerator, denominator, out=depth, where=surface)
    return np.minimum(depth, np.finfo(np.float32).max, out=depth, where=surface)
