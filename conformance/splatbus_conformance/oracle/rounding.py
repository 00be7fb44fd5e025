"""From exact rational numbers to floating point, rounded once, to nearest, ties to even."""

import math
from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple

Real = int | float | Fraction

_ROOT_BITS = 400


class Format(NamedTuple):
    """A binary floating-point format of IEEE 754."""

    digits: int
    """Bits of the significand, the leading one included."""
    min_exponent: int
    max_exponent: int


SINGLE = Format(24, -126, 127)
DOUBLE = Format(53, -1022, 1023)
SINGLE_MAX = Fraction(2**24 - 1) * 2**104


def exact(values: Iterable[Real]) -> tuple[Fraction, ...]:
    """Return the numbers as they are; ValueError or OverflowError for NaN and infinities."""
    return tuple(Fraction(value) for value in values)


def square_root(value: Fraction) -> Fraction:
    """Return √value to a relative error below 2⁻⁴⁰⁰, and exactly where it is rational."""
    numerator, denominator = value.as_integer_ratio()
    root = Fraction(math.isqrt(numerator), math.isqrt(denominator))
    if root * root == value:
        return root
    # √(n/d) = √(n·d·4^k) / (d·2^k), with k so large that the integer root has enough bits.
    shift = _ROOT_BITS + denominator.bit_length()
    return Fraction(math.isqrt(numerator * denominator << 2 * shift), denominator << shift)


def ulp(value: Fraction, form: Format) -> Fraction:
    """Return the distance of adjacent numbers of a format in the binade of `value`."""
    numerator, denominator = abs(value).as_integer_ratio()
    exponent = numerator.bit_length() - denominator.bit_length()
    if value and abs(value) < Fraction(2) ** exponent:
        exponent -= 1
    if not value:
        exponent = form.min_exponent
    return Fraction(2) ** (max(exponent, form.min_exponent) - form.digits + 1)


def rounded(value: Fraction, form: Format) -> float:
    """Return the number of a format (as a float) nearest to `value`, infinity beyond its range."""
    step = ulp(value, form)
    nearest = round(value / step) * step
    if abs(nearest) >= Fraction(2) ** (form.max_exponent + 1):
        return math.inf if value > 0 else -math.inf
    return float(nearest)


def to_double(value: Fraction) -> float:
    """Return the double nearest to `value`, infinity beyond the range."""
    return rounded(value, DOUBLE)


def to_single(value: Fraction) -> float:
    """Return the single-precision number nearest to `value`, as a float; infinity beyond."""
    return rounded(value, SINGLE)
