"""Depth of a surface from what a splatting rasteriser accumulates [ACC-8, ACC-9]."""

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS

COVERED_ALPHA_MIN = np.float32(LIMITS["covered_alpha_min"])

Float32Array = NDArray[np.float32]


def covered(inverse_depth: Float32Array, alpha: Float32Array | None = None) -> NDArray[np.bool_]:
    """Return where a surface is: A ≥ 1/255, d > 0, and both finite [ACC-9].

    Args:
        inverse_depth: d = Σ(1/zᵢ)·αᵢ·Tᵢ, float32, any shape.
        alpha: A = Σαᵢ·Tᵢ, float32, the same shape; None where the renderer gives none.
    """
    # No finite number is less than infinity, and no NaN is less than anything.
    with_depth = (inverse_depth > 0) & (inverse_depth < np.inf)
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
        out: float32 array of the same shape to write to.

    Raises:
        TypeError: an input is not float32; rounding wider numbers first would round twice.
    """
    for array in (inverse_depth, alpha):
        if array is not None and array.dtype != np.float32:
            raise TypeError(f"inverse depth and alpha must be float32, not {array.dtype}")
    surface = covered(inverse_depth, alpha)
    depth = np.empty_like(inverse_depth) if out is None else out
    depth.fill(empty)
    numerator = np.float32(1) if alpha is None else alpha
    with np.errstate(over="ignore"):
        np.divide(numerator, inverse_depth, out=depth, where=surface)
    return np.minimum(depth, np.finfo(np.float32).max, out=depth, where=surface)
