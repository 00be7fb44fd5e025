"""Exact errors fast enough for a search: numbers as integers over powers of two.

`fractions` reduces every result to lowest terms; without that an error takes a twentieth of the
time. What a search finds is restated by the conformance harness's oracle, which shares no code.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

Numbers = Sequence[float]


class Over(NamedTuple):
    """Numbers with one positive denominator."""

    numerators: tuple[int, ...]
    denominator: int


def over(values: Numbers) -> Over:
    """The numbers, exactly."""
    ratios = [value.as_integer_ratio() for value in values]
    common = max(ratio[1] for ratio in ratios)
    return Over(tuple(n * (common // d) for n, d in ratios), common)


@lru_cache(maxsize=1 << 16)
def rotation(q: tuple[float, ...]) -> Over:
    """The nine entries of R."""
    (x, y, z, w), _ = over(q)
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    entries = (
        ww + xx - yy - zz, 2 * (x * y - z * w), 2 * (x * z + y * w),
        2 * (x * y + z * w), ww + yy - xx - zz, 2 * (y * z - x * w),
        2 * (x * z - y * w), 2 * (y * z + x * w), ww + zz - xx - yy,
    )  # fmt: skip
    return Over(entries, xx + yy + zz + ww)


def product(A: Over, B: Over, *, transposed: bool = False) -> Over:
    """A·B or Aᵀ·B of 3×3 entries, or of a matrix and a vector."""
    columns = len(B.numerators) // 3
    a, b = A.numerators, B.numerators
    entries = tuple(
        sum((a[3 * k + i] if transposed else a[3 * i + k]) * b[columns * k + j] for k in range(3))
        for i in range(3)
        for j in range(columns)
    )
    return Over(entries, A.denominator * B.denominator)


def differences(got: Numbers, exact: Over) -> list[float]:
    """got − exact, each rounded once."""
    if not all(map(math.isfinite, got)):
        return [math.inf] * len(got)
    below = exact.denominator
    found = []
    for value, n in zip(got, exact.numerators, strict=True):
        numerator, denominator = value.as_integer_ratio()
        found.append((numerator * below - n * denominator) / (denominator * below))
    return found


def entry_error(got: Numbers, exact: Over) -> float:
    """The largest difference."""
    return max(map(abs, differences(got, exact)))


def norm_error(got: Numbers, exact: Over) -> float:
    """‖got − exact‖ / max(1, ‖exact‖)."""
    length = math.hypot(*(n / exact.denominator for n in exact.numerators))
    return math.hypot(*differences(got, exact)) / max(1.0, length)


def orthogonality_error(R: Numbers) -> float:
    """‖RᵀR − I‖₂."""
    if not all(map(math.isfinite, R)):
        return math.inf
    exact = over(R)
    gram = product(exact, exact, transposed=True)
    one = gram.denominator
    deviation: Any = [(n - (one if i % 4 == 0 else 0)) / one for i, n in enumerate(gram.numerators)]
    return float(np.abs(np.linalg.eigvalsh(np.reshape(deviation, (3, 3)))).max())
