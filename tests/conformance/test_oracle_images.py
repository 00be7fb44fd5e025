import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.oracle.images import composite, planar_depth

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
