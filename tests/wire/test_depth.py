import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance import oracle
from splatbus_wire.depth import COVERED_ALPHA_MIN, covered, planar_depth

singles = st.floats(width=32) | st.sampled_from([0.0, -0.0, 1e-45, 2e-6, 1e-6, math.nan, math.inf])
alphas = st.floats(0, 1, width=32) | singles


def single(*values):
    return np.array(values, np.float32)


@settings(deadline=None, max_examples=150)
@given(st.lists(st.tuples(singles, alphas), min_size=1, max_size=40))
@example([(1e-45, 1.0)])  # overflows
@example([(0.125, 0.5), (2e-6, 1.0), (1e-6, 1.0)])
def test_depth_is_the_correctly_rounded_quotient(pixels):
    d, A = single(*pixels).T
    expected = [oracle.planar_depth(float(a), float(b)) for a, b in zip(d, A, strict=True)]
    assert planar_depth(d, A).tolist() == expected  # ACC-8
    assert (covered(d, A) == np.isfinite(expected)).all()  # ACC-9


def test_without_alpha_it_is_the_reciprocal():
    assert planar_depth(single(0.25, 0.0, math.nan)).tolist() == [4.0, math.inf, math.inf]


def test_it_divides_by_alpha():
    assert planar_depth(single(0.125), single(0.5)).tolist() == [4.0]


def test_the_threshold_of_alpha_is_the_first_single_not_below_a_255th():
    below = np.nextafter(COVERED_ALPHA_MIN, np.float32(0))
    assert Fraction(float(below)) < Fraction(1, 255) <= Fraction(float(COVERED_ALPHA_MIN))
    assert covered(single(1, 1), np.array([below, COVERED_ALPHA_MIN])).tolist() == [False, True]


def test_depth_falls_as_inverse_depth_rises():
    d = single(*np.geomspace(1e-38, 1e38, 500))
    depth = planar_depth(d, np.full_like(d, 0.5))
    assert (np.diff(depth) <= 0).all()
    assert np.isfinite(depth).all()


def test_empty_pixels_hold_what_the_server_chose_and_may_be_written_in_place():
    out = np.zeros((2, 2), np.float32)
    d = single(0.5, 0, -1, math.inf).reshape(2, 2)
    assert planar_depth(d, empty=100.0, out=out) is out
    assert out.tolist() == [[2, 100], [100, 100]]


@pytest.mark.parametrize("d", [np.ones(2), np.ones(2, np.float16)])
def test_wider_or_narrower_numbers_are_refused(d):
    with pytest.raises(TypeError, match="float32"):
        planar_depth(d)
    with pytest.raises(TypeError, match="float32"):
        planar_depth(np.ones(2, np.float32), d)
