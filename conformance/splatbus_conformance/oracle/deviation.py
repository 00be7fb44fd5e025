"""How far a result is from the exact one, in the units of the accuracy budgets (chapter 8)."""

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from splatbus_conformance.oracle.rotations import (
    Rows,
    multiply,
    norm,
    product,
    transpose,
)
from splatbus_conformance.oracle.rounding import Format, Real, exact, to_double, ulp

U = Fraction(1, 2**53)
"""Unit roundoff of double precision."""


def error_in_u(got: Sequence[float], expected: Sequence[Fraction]) -> float:
    """Return the largest error of a component, in u; infinite where a number is not finite."""
    if not all(map(math.isfinite, got)):
        return math.inf
    differences = (abs(a - b) for a, b in zip(exact(got), expected, strict=True))
    return to_double(max(differences) / U)


def norm_error(got: Sequence[float], expected: Sequence[Fraction]) -> float:
    """Return ‖got − expected‖ / max(1, ‖expected‖); infinite where a number is not finite."""
    if not all(map(math.isfinite, got)):
        return math.inf
    difference = [a - b for a, b in zip(exact(got), expected, strict=True)]
    return to_double(norm(difference) / max(Fraction(1), norm(expected)))


def ulps(got: float, expected: Fraction, form: Format) -> float:
    """Return the error of one number in units in the last place of a format, at `expected`."""
    if not math.isfinite(got):
        return math.inf
    return to_double(abs(Fraction(got) - expected) / ulp(expected, form))


def orthogonality_error(R: Sequence[Sequence[float]]) -> float:
    """Return ‖RᵀR − I‖₂ of a 3×3 matrix of floats (ACC-3)."""
    rows: Rows = tuple(exact(row) for row in R)
    gram = multiply(transpose(rows), rows)
    deviation = [[to_double(gram[i][j] - (i == j)) for j in range(3)] for i in range(3)]
    return float(np.linalg.norm(np.array(deviation), 2))


def angle_between(p: Sequence[Real], q: Sequence[Real]) -> float:
    """Return the angle in radians, 0 to π, between two rotations (x, y, z, w) of any norm.

    Computed from sine and cosine of the half angle, so that small angles keep their digits.
    """
    x, y, z, w = exact(p)
    *v, cosine = product((-x, -y, -z, w), exact(q))
    sine = norm(v)
    scale = max(sine, abs(cosine))
    return 2.0 * math.atan2(to_double(sine / scale), to_double(abs(cosine) / scale))
