"""How far a result is from the exact one: against mpmath and SciPy."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from splatbus_conformance.oracle import deviation
from splatbus_conformance.oracle.rounding import DOUBLE, SINGLE


def test_errors_are_counted_in_units_of_their_format_or_of_what_is_expected():
    assert deviation.error_in_u((1 + 2**-52, 0.5), (Fraction(1), Fraction(1, 2))) == 2
    assert deviation.norm_error((0.5, 0, 0), (Fraction(1, 4), 0, 0)) == 0.25
    assert deviation.norm_error((30, 44), (Fraction(30), Fraction(40))) == 0.08
    assert deviation.ulps(1 + 2**-23, Fraction(1), SINGLE) == 1
    assert deviation.ulps(1 + 2**-23, Fraction(1), DOUBLE) == 2**29


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_infinitely_wrong(number):
    assert deviation.error_in_u((0.0, number), (Fraction(0), Fraction(0))) == math.inf
    assert deviation.norm_error((number,), (Fraction(0),)) == math.inf
    assert deviation.ulps(number, Fraction(0), SINGLE) == math.inf


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9), st.floats(1e-18, 1))
def test_the_spectral_norm_is_that_of_mpmath(entries, size):
    R = np.eye(3) + size * np.reshape(entries, (3, 3))
    with mpmath.workprec(300):
        exact = mpmath.matrix(R.tolist())
        values = mpmath.eigsy(exact.T * exact - mpmath.eye(3), eigvals_only=True)
        expected = float(max(abs(value) for value in values))
    assert deviation.orthogonality_error(R.tolist()) == pytest.approx(expected, rel=1e-13)


@settings(deadline=None, max_examples=50)
@given(st.floats(1e-12, 3.14), st.tuples(*[st.floats(0.1, 1)] * 3), st.floats(0.1, 10))
def test_the_angle_between_rotations_is_the_one_turned_by(angle, axis, scale):
    axis = np.array(axis) / np.linalg.norm(axis)
    start = Rotation.from_euler("xyz", [0.3, -1.2, 2.0])
    turned = start * Rotation.from_rotvec(angle * axis)
    got = deviation.angle_between(start.as_quat(), -scale * turned.as_quat())
    assert got == pytest.approx(angle, abs=2e-15)
