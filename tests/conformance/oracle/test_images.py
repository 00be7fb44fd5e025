"""Depth and compositing, against NumPy's single precision and against themselves."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.oracle.images import (
    accumulate,
    composite,
    expected_depth,
    planar_depth,
    surface_depth,
)

LARGEST = float(np.finfo(np.float32).max)
FIRST_COVERED = np.float32(1 / 255)
depths = st.floats(2.0**-20, 2.0**20, width=32)
opacities = st.floats(2.0**-6, 1, width=32)
units = st.floats(0, 1, width=32)
some = settings(deadline=None, max_examples=60)
each_estimate = pytest.mark.parametrize("estimate", [planar_depth, expected_depth, surface_depth])


@some
@given(depths, opacities)
def test_depth_is_numpys_single_precision_quotient(depth, alpha):
    assert planar_depth(depth, alpha) == np.float32(alpha) / np.float32(depth)
    assert expected_depth(depth, alpha) == np.float32(depth) / np.float32(alpha)
    assert surface_depth(depth, alpha) == depth


@each_estimate
def test_every_estimator_knows_empty_pixels(estimate):
    none = [(depth, 1.0) for depth in (0.0, -1.0, math.inf, math.nan)]
    below = np.nextafter(FIRST_COVERED, np.float32(0))
    for depth, alpha in (*none, (1.0, math.nan), (1.0, float(below))):
        assert estimate(depth, alpha, empty=100.0) == 100.0
    assert estimate(1.0, float(FIRST_COVERED), empty=100.0) != 100.0


@pytest.mark.parametrize(("estimate", "depth"), [(planar_depth, 1e-45), (expected_depth, LARGEST)])
def test_a_quotient_that_overflows_is_the_largest_depth(estimate, depth):
    assert estimate(depth, 1.0 if depth < 1 else 0.5) == LARGEST


@some
@given(st.lists(st.tuples(depths, opacities), min_size=1, max_size=8))
def test_sums_are_those_of_numpy(layers):
    z, alpha = np.array(layers).T
    weight = alpha * np.concatenate([[1], np.cumprod(1 - alpha)[:-1]])
    sums = accumulate(layers)
    assert float(sums.alpha) == pytest.approx(weight.sum(), rel=1e-12)
    assert float(sums.depth) == pytest.approx((weight * z).sum(), rel=1e-12)
    assert float(sums.inverse_depth) == pytest.approx((weight / z).sum(), rel=1e-12)
    before = (accumulate(layers[:count]) for count in range(1, len(layers)))
    halves = (z for it, (z, _) in zip(before, layers, strict=False) if it.alpha >= Fraction(1, 2))
    assert sums.median == next(halves, layers[-1][0])


@some
@given(st.tuples(units, units, units, opacities), st.tuples(units, units, units))
def test_straight_colour_is_premultiplied_colour_that_was_multiplied(splat, under):
    *colour, alpha = map(Fraction, splat)
    pairs = zip(colour, map(Fraction, under), strict=True)
    expected = tuple(alpha * c + (1 - alpha) * b for c, b in pairs)
    assert composite(splat, 1, under, 2) == expected
    multiplied = (*(alpha * c for c in colour), alpha)
    assert composite(multiplied, 1, under, 2, premultiplied=True) == expected


@pytest.mark.parametrize("depth", [2.0, 3.0, math.inf, math.nan, 0.0, -1.0, 1.5])
def test_what_is_empty_or_not_in_front_gives_the_background(depth):
    under = (0.25, 0.5, 0.75)
    assert composite((1, 1, 1, 1), depth, under, 2.0, empty=1.5) == under
    assert composite((math.nan, math.inf, 1, 0), 1, under, 2.0) == under
