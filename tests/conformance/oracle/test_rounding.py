import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance.oracle.rounding import (
    DOUBLE,
    SINGLE,
    SINGLE_MAX,
    square_root,
    to_double,
    to_single,
    ulp,
)

ratios = st.fractions() | st.builds(
    lambda n, e: n * Fraction(10) ** e, st.integers(-(10**30), 10**30), st.integers(-330, 300)
)


@settings(deadline=None)
@example(Fraction(179769314 * 10**300))
@example(Fraction(-(10**400)))
@given(ratios)
def test_doubles_are_those_of_the_standard_library(value):
    try:
        assert to_double(value) == float(value)
    except OverflowError:
        assert math.isinf(to_double(value))


@settings(deadline=None)
@given(st.floats(allow_nan=False))
def test_singles_are_those_of_numpy(value):
    with np.errstate(over="ignore"):
        expected = float(np.float32(value))
    got = to_single(Fraction(value)) if math.isfinite(value) else value
    assert got == expected


def test_a_tie_goes_to_even_and_is_not_rounded_twice():
    tie = 1 + Fraction(1, 2**24)
    assert to_single(tie) == 1.0
    # To double first, this would be the tie.
    assert to_single(tie + Fraction(1, 2**80)) == 1 + 2**-23


def test_ties_among_subnormals_go_to_even():
    least = Fraction(1, 2**149)
    assert to_single(least / 2) == 0
    assert to_single(least * 3 / 2) == float(2 * least)
    assert to_single(least * Fraction(1, 2) + Fraction(1, 2**400)) == float(least)
    assert to_double(Fraction(1, 2**1075)) == 0
    assert to_double(Fraction(3, 2**1075)) == 2 * 5e-324
    assert to_double(-Fraction(1, 2**1075) - Fraction(1, 2**2000)) == -5e-324


def test_the_largest_single_is_the_last_before_infinity():
    step = Fraction(2) ** 104
    assert to_single(SINGLE_MAX) == float(np.finfo(np.float32).max)
    assert to_single(SINGLE_MAX + step / 3) == float(SINGLE_MAX)
    assert to_single(-SINGLE_MAX - step / 2) == -math.inf


@settings(deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_an_ulp_is_the_distance_to_the_next_number_outward(value):
    assert ulp(Fraction(value), DOUBLE) == Fraction(math.ulp(value))


@settings(deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_an_ulp_of_single_precision_is_numpys_spacing(value):
    expected = (
        abs(float(np.spacing(np.float32(abs(value))))) if abs(value) != SINGLE_MAX else 2.0**104
    )
    assert ulp(Fraction(value), SINGLE) == Fraction(expected)


@settings(deadline=None)
@given(st.fractions(min_value=0) | st.floats(0, 1e300).map(Fraction))
def test_square_roots_are_good_to_400_bits(value):
    with mpmath.workprec(1500):
        exact = mpmath.sqrt(mpmath.mpf(value.numerator) / value.denominator)
        got = square_root(value)
        error = abs(mpmath.mpf(got.numerator) / got.denominator - exact)
        assert error <= exact * mpmath.mpf(2) ** -400


@pytest.mark.parametrize("root", [Fraction(0), Fraction(1), Fraction(3, 7), Fraction(2) ** -1074])
def test_rational_roots_are_exact(root):
    assert square_root(root * root) == root
