"""Depth and compositing in exact arithmetic, a pixel at a time (spec 1.0 chapters 5 and 8)."""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from splatbus_conformance.oracle.rounding import SINGLE_MAX, Real, exact, to_single


class Accumulated(NamedTuple):
    """What blending layers from front to back adds up to, Tᵢ = ∏(1 − αⱼ) over those before i."""

    alpha: Fraction
    """A = Σαᵢ·Tᵢ."""
    inverse_depth: Fraction
    """d = Σ(1/zᵢ)·αᵢ·Tᵢ, of which the harmonic mean is A/d."""
    depth: Fraction
    """D = Σzᵢ·αᵢ·Tᵢ, of which the expected depth is D/A."""
    median: Fraction
    """z of the first layer behind which no more than half of the light is left, else the last."""


def accumulate(layers: Sequence[tuple[Real, Real]]) -> Accumulated:
    """Return the sums over at least one layer (zᵢ, αᵢ), the nearest first, exactly."""
    left = Fraction(1)
    weights, depths, median = [], [], Fraction(0)
    for z, alpha in map(exact, layers):
        if left > Fraction(1, 2):
            median = z
        weights.append(alpha * left)
        depths.append(z)
        left *= 1 - alpha
    pairs = list(zip(weights, depths, strict=True))
    return Accumulated(
        sum(weights, Fraction(0)),
        sum((weight / z for weight, z in pairs), Fraction(0)),
        sum((weight * z for weight, z in pairs), Fraction(0)),
        median,
    )


def planar_depth(inverse_depth: float, alpha: float = 1.0, *, empty: float = math.inf) -> float:
    """Return A/d correctly rounded to single precision, or `empty` (ACC-8, ACC-9).

    Args:
        inverse_depth: d = Σ(1/zᵢ)·αᵢ·Tᵢ.
        alpha: A = Σαᵢ·Tᵢ, 1 where the renderer gives none.
        empty: the depth of a pixel that is not covered.
    """
    if not _covered(inverse_depth, alpha):
        return empty
    return _finite_single(Fraction(alpha) / Fraction(inverse_depth))


def expected_depth(
    accumulated_depth: float, alpha: float = 1.0, *, empty: float = math.inf
) -> float:
    """Return D/A correctly rounded to single precision, or `empty`; D = Σzᵢ·αᵢ·Tᵢ."""
    if not _covered(accumulated_depth, alpha):
        return empty
    return _finite_single(Fraction(accumulated_depth) / Fraction(alpha))


def surface_depth(z: float, alpha: float = 1.0, *, empty: float = math.inf) -> float:
    """Return z rounded to single precision, or `empty`; z is a median, or a surface's own depth."""
    return _finite_single(Fraction(z)) if _covered(z, alpha) else empty


def _covered(depth: float, alpha: float) -> bool:
    finite = math.isfinite(depth) and math.isfinite(alpha)
    return finite and depth > 0 and Fraction(alpha) >= Fraction(1, 255)


def _finite_single(depth: Fraction) -> float:
    return min(to_single(depth), float(SINGLE_MAX))


def composite(
    splat: Sequence[float],
    depth: float,
    background: Sequence[float],
    background_depth: float,
    *,
    premultiplied: bool = False,
    empty: float = math.inf,
) -> tuple[Fraction, ...]:
    """Return red, green, blue of a splat pixel over a background, exactly (ACC-10, BUF-8, BUF-9).

    Args:
        splat: red, green, blue, alpha.
        depth: of the splat; +∞, NaN and what is not positive are no surface.
        background: red, green, blue.
        background_depth: of the client's own geometry, +∞ where there is none.
        premultiplied: red, green, blue of `splat` are multiplied by alpha already.
        empty: `semantics.depth.empty` of 1.1, the depth of an empty pixel (MEM-13).
    """
    under = exact(background)
    if not 0 < depth < background_depth or depth == empty or splat[3] == 0:
        return under
    *colour, alpha = exact(splat)
    weight = Fraction(1) if premultiplied else alpha
    return tuple(weight * c + (1 - alpha) * b for c, b in zip(colour, under, strict=True))
