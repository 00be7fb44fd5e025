"""Depth and compositing in exact arithmetic, a pixel at a time (spec 1.0 chapter 8)."""

import math
from collections.abc import Sequence
from fractions import Fraction

from splatbus_conformance.oracle.rounding import SINGLE_MAX, exact, to_single


def planar_depth(inverse_depth: float, alpha: float = 1.0, *, empty: float = math.inf) -> float:
    """Return A/d correctly rounded to single precision, or `empty` (ACC-8, ACC-9).

    Args:
        inverse_depth: d = Σ(1/zᵢ)·αᵢ·Tᵢ.
        alpha: A = Σαᵢ·Tᵢ, 1 where the renderer gives none.
        empty: the depth of a pixel that is not covered.
    """
    if not (math.isfinite(inverse_depth) and math.isfinite(alpha)):
        return empty
    d, A = exact((inverse_depth, alpha))
    if d <= 0 or Fraction(1, 255) > A:
        return empty
    return min(to_single(A / d), float(SINGLE_MAX))


def composite(
    splat: Sequence[float],
    depth: float,
    background: Sequence[float],
    background_depth: float,
    *,
    premultiplied: bool = False,
) -> tuple[Fraction, ...]:
    """Return red, green, blue of a splat pixel over a background, exactly (ACC-10, BUF-8, BUF-9).

    Args:
        splat: red, green, blue, alpha.
        depth: of the splat; +∞, NaN and what is not positive are no surface.
        background: red, green, blue.
        background_depth: of the client's own geometry, +∞ where there is none.
        premultiplied: red, green, blue of `splat` are multiplied by alpha already.
    """
    under = exact(background)
    if not 0 < depth < background_depth or splat[3] == 0:
        return under
    *colour, alpha = exact(splat)
    weight = Fraction(1) if premultiplied else alpha
    return tuple(weight * c + (1 - alpha) * b for c, b in zip(colour, under, strict=True))
