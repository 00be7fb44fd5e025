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
FIRST_COVERED = float(np.float32(1 / 255))


@settings(deadline=None)
@given(st.floats(2.0**-100, 2.0**100, width=32), st.floats(2.0**-6, 1, width=32))
def test_depth_is_numpys_single_precision_quotient(d, alpha):
    assert planar_depth(d, alpha) == np.float32(alpha) / np.float32(d)


@pytest.mark.parametrize(
    ("d", "alpha", "depth"),
    [
        (0.125, 0.5, 4.0),
        (0.125, 1.0, 8.0),
        (1e-45, 1.0, LARGEST),
        (0.0, 1.0, math.inf),
        (-0.0, 1.0, math.inf),
        (-1.0, 1.0, math.inf),
        (1.0, 0.0, math.inf),
        (1.0, 0.0039, math.inf),
        (1.0, FIRST_COVERED, FIRST_COVERED),
        (1.0, float(np.nextafter(np.float32(FIRST_COVERED), np.float32(0))), math.inf),
        (math.nan, 1.0, math.inf),
        (math.inf, 1.0, math.inf),
        (1.0, math.nan, math.inf),
        (1.0, math.inf, math.inf),
    ],
)
def test_depth_at_the_edges(d, alpha, depth):
    assert planar_depth(d, alpha) == depth


def test_an_empty_pixel_has_the_depth_that_was_asked_for():
    assert planar_depth(0.0, 0.0, empty=100.0) == 100.0


def test_composites_of_chapter_8():
    assert composite((0.5, 0.5, 0.5, 0.5), 1, (0, 0, 0), math.inf) == (Fraction(1, 4),) * 3
    premultiplied = composite((0.25,) * 3 + (0.5,), 1, (0, 0, 0), 2, premultiplied=True)
    assert premultiplied == (Fraction(1, 4),) * 3


@pytest.mark.parametrize("depth", [2.0, 3.0, math.inf, math.nan, 0.0, -1.0])
def test_what_is_not_in_front_gives_the_background(depth):
    assert composite((1, 1, 1, 1), depth, (0.25, 0.5, 0.75), 2.0) == (0.25, 0.5, 0.75)


def test_an_empty_pixel_gives_the_background_whatever_its_colour():
    splat = (math.nan, math.inf, 1, 0)
    assert composite(splat, 1, (0, 0.5, 1), math.inf) == (0, 0.5, 1)
    assert composite(splat, 1, (0, 0.5, 1), math.inf, premultiplied=True) == (0, 0.5, 1)


depths = st.floats(2.0**-20, 2.0**20, width=32)
opacities = st.floats(2.0**-10, 1, width=32)
rays = st.lists(st.tuples(depths, opacities), min_size=1, max_size=8)


@settings(deadline=None, max_examples=60)
@given(depths, opacities)
def test_one_layer_is_where_every_estimator_finds_it(z, alpha):
    sums = accumulate([(z, alpha)])
    assert sums.alpha == Fraction(alpha)
    assert sums.alpha / sums.inverse_depth == sums.depth / sums.alpha == sums.median == z


@settings(deadline=None, max_examples=60)
@given(opacities, st.integers(1, 30), depths)
def test_equal_layers_add_up_to_a_geometric_series(alpha, count, z):
    sums = accumulate([(z, alpha)] * count)
    assert sums.alpha == 1 - (1 - Fraction(alpha)) ** count
    assert sums.depth == sums.alpha * Fraction(z)
    assert sums.inverse_depth == sums.alpha / Fraction(z)


@settings(deadline=None, max_examples=60)
@given(rays)
def test_the_harmonic_mean_is_between_the_nearest_and_the_arithmetic_one(layers):
    sums = accumulate(layers)
    harmonic, expected = sums.alpha / sums.inverse_depth, sums.depth / sums.alpha
    nearest, farthest = min(layers)[0], max(layers)[0]
    assert nearest <= harmonic <= expected <= farthest


@settings(deadline=None, max_examples=60)
@given(rays)
def test_sums_are_those_of_numpy(layers):
    z, alpha = np.array(layers).T
    weight = alpha * np.concatenate([[1], np.cumprod(1 - alpha)[:-1]])
    sums = accumulate(layers)
    assert float(sums.alpha) == pytest.approx(weight.sum(), rel=1e-12)
    assert float(sums.depth) == pytest.approx((weight * z).sum(), rel=1e-12)
    assert float(sums.inverse_depth) == pytest.approx((weight / z).sum(), rel=1e-12)


@settings(deadline=None, max_examples=60)
@given(rays)
def test_the_median_is_where_the_weights_reach_a_half(layers):
    reached, median = Fraction(0), layers[-1][0]
    for count, (z, _) in enumerate(layers, 1):
        reached = accumulate(layers[:count]).alpha
        if reached >= Fraction(1, 2):
            median = z
            break
    assert accumulate(layers).median == median


def test_the_layers_of_numerics():
    sums = accumulate([(2, Fraction(1, 2)), (10, 1)])
    assert sums.alpha / sums.inverse_depth == Fraction(10, 3)
    assert (sums.depth / sums.alpha, sums.median) == (6, 2)


@settings(deadline=None)
@given(st.floats(2.0**-100, 2.0**100, width=32), st.floats(2.0**-6, 1, width=32))
def test_expected_depth_is_numpys_single_precision_quotient(accumulated, alpha):
    assert expected_depth(accumulated, alpha) == np.float32(accumulated) / np.float32(alpha)


@pytest.mark.parametrize("estimate", [planar_depth, expected_depth, surface_depth])
@pytest.mark.parametrize(
    ("given_depth", "alpha"),
    [(0.0, 1.0), (-1.0, 1.0), (math.inf, 1.0), (math.nan, 1.0), (1.0, math.nan), (1.0, 0.0039)],
)
def test_every_estimator_knows_empty_pixels(estimate, given_depth, alpha):
    assert estimate(given_depth, alpha, empty=100.0) == 100.0
    assert estimate(1.0, FIRST_COVERED, empty=100.0) != 100.0


def test_expected_and_given_depth_at_the_edges():
    assert expected_depth(2.0, 0.5) == 4.0
    assert expected_depth(LARGEST, 0.5) == LARGEST
    assert surface_depth(4.0, 0.5) == 4.0
    assert surface_depth(1.401298464324817e-45) == 1.401298464324817e-45
    assert surface_depth(100.0) == 100.0


units = st.floats(0, 1, width=32)


@settings(deadline=None, max_examples=60)
@given(st.tuples(units, units, units, units), st.tuples(units, units, units))
def test_straight_colour_is_premultiplied_colour_that_was_multiplied(splat, under):
    *colour, alpha = map(Fraction, splat)
    multiplied = (*(alpha * c for c in colour), alpha)
    straight = composite(splat, 1, under, 2)
    assert straight == composite(multiplied, 1, under, 2, premultiplied=True)


@settings(deadline=None, max_examples=60)
@given(*[st.tuples(units, units, units, units)] * 2, st.tuples(units, units, units))
def test_two_premultiplied_layers_are_one_that_was_composed(front, back, under):
    """Porter and Duff's operator is associative (Compositing Digital Images, 1984)."""
    *near, a = map(Fraction, front)
    *far, b = map(Fraction, back)
    both = (*(c + (1 - a) * d for c, d in zip(near, far, strict=True)), a + (1 - a) * b)
    step = composite(back, 2, under, 3, premultiplied=True) if b else tuple(map(Fraction, under))
    twice = composite(front, 1, step, 3, premultiplied=True) if a else step
    assert not a or not b or composite(both, 1, under, 3, premultiplied=True) == twice


def test_what_is_announced_as_empty_is():
    splat = (1, 1, 1, 0.5)
    assert composite(splat, 100.0, (0, 0, 0), 250.0, empty=100.0) == (0, 0, 0)
    assert composite(splat, 100.0, (0, 0, 0), 250.0) == (Fraction(1, 2),) * 3
