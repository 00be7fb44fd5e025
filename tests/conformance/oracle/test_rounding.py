"""Rounding, against Python's own, NumPy's and mpmath's."""

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
finite = st.floats(allow_nan=False, allow_infinity=False)
plain = settings(deadline=None)


@plain
@example(Fraction(179769314 * 10**300))
@example(Fraction(-(10**400)))
@example(Fraction(3, 2**1075))
@given(ratios)
def test_doubles_are_those_of_the_standard_library(value):
    try:
        assert to_double(value) == float(value)
    except OverflowError:
        assert to_double(value) == (math.inf if value > 0 else -math.inf)


@plain
@example(float(SINGLE_MAX) + 2.0**103)
@example(3 * 2.0**-150)
@given(finite)
def test_singles_are_those_of_numpy(value):
    with np.errstate(over="ignore"):
        assert to_single(Fraction(value)) == np.float32(value)


def test_a_number_is_not_rounded_twice():
    # To double first, this would be a tie.
    assert to_single(1 + Fraction(1, 2**24) + Fraction(1, 2**80)) == 1 + 2**-23


@plain
@given(finite)
def test_an_ulp_is_the_distance_to_the_next_number_outward(value):
    assert ulp(Fraction(value), DOUBLE) == Fraction(math.ulp(value))
    with np.errstate(over="ignore"):
        single = np.float32(value)
    if abs(single) < np.finfo(np.float32).max:
        assert ulp(Fraction(float(single)), SINGLE) == float(np.spacing(abs(single)))


@plain
@given(st.fractions(min_value=0) | st.floats(0, 1e300).map(Fraction))
def test_square_roots_are_good_to_400_bits(value):
    with mpmath.workprec(1500):
        exact = mpmath.sqrt(mpmath.mpf(value.numerator) / value.denominator)
        got = square_root(value)
        error = abs(mpmath.mpf(got.numerator) / got.denominator - exact)
        assert error <= exact * mpmath.mpf(2) ** -400


@pytest.mark.parametrize("root", [Fraction(0), Fraction(3, 7), Fraction(2) ** -1074])
def test_rational_roots_are_exact(root):
    assert square_root(root * root) == root
