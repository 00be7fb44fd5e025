import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import SINGLE
from splatbus_wire.depth import (
    covered,
    expected_depth,
    planar_depth,
    surface_depth,
)

from tests.wire.stress import within

singles = st.floats(width=32) | st.sampled_from([0.0, -0.0, 1e-45, 2e-6, 1e-6, math.nan, math.inf])
alphas = st.floats(0, 1, width=32) | singles


def single(*values):
    return np.array(values, np.float32)


@pytest.mark.parametrize(
    ("estimate", "exact"),
    [
        (planar_depth, oracle.planar_depth),
        (expected_depth, oracle.expected_depth),
        (surface_depth, oracle.surface_depth),
    ],
)
@settings(deadline=None, max_examples=150)
@given(st.lists(st.tuples(singles, alphas), min_size=1, max_size=40))
@example([(1e-45, 1.0)])  # overflows
@example([(0.125, 0.5), (2e-6, 1.0), (1e-6, 1.0)])
@example([(3e38, 0.5), (1e-45, 1.0), (1e-45, 0.01), (100.0, 1.0)])
def test_every_estimator_is_correctly_rounded(estimate, exact, pixels):
    given_depth, A = single(*pixels).T
    expected = [exact(float(a), float(b)) for a, b in zip(given_depth, A, strict=True)]
    assert estimate(given_depth, A).tolist() == expected  # ACC-8
    assert estimate(given_depth).tolist() == [exact(float(a)) for a in given_depth]
    if estimate is planar_depth:
        assert (covered(given_depth, A) == np.isfinite(expected)).all()  # ACC-9


@pytest.mark.parametrize("estimate", [planar_depth, expected_depth, surface_depth])
def test_every_estimator_can_write_in_place_what_the_server_chose(estimate):
    out = np.zeros((2, 2), np.float32)
    given_depth = single(1, 0, -1, math.nan).reshape(2, 2)
    assert estimate(given_depth, np.ones_like(out), empty=100.0, out=out) is out
    assert out.tolist() == [[1, 100], [100, 100]]


@settings(deadline=None, max_examples=200)
@given(st.integers(1, 0x7F7FF000), st.integers(0x3B808081, 0x3F800000))
def test_no_step_of_inverse_depth_is_out_of_order_or_more_than_half_an_ulp_off(bits, alpha_bits):
    """Over 4,096 adjacent numbers from 1e-45 to 3e38, and every alpha that covers."""
    d = np.arange(bits, bits + 4096, dtype=np.uint32).view(np.float32)
    A = np.full_like(d, np.array(alpha_bits, np.uint32).view(np.float32))
    depth = planar_depth(d, A)
    assert (np.diff(depth) <= 0).all()  # ACC-12
    if depth[0] < np.finfo(np.float32).max:
        error = oracle.ulps(float(depth[0]), Fraction(float(A[0])) / Fraction(float(d[0])), SINGLE)
        within("depth A/d", error, 0.5, "ULP", (float(d[0]), float(A[0])))  # ACC-8


@pytest.mark.parametrize("d", [np.ones(2), np.ones(2, np.float16)])
def test_wider_or_narrower_numbers_are_refused(d):
    for estimate in (planar_depth, expected_depth, surface_depth):
        with pytest.raises(TypeError, match="float32"):
            estimate(d)
        with pytest.raises(TypeError, match="float32"):
            estimate(np.ones(2, np.float32), d)
