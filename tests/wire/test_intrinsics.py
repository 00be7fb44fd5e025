import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.oracle.intrinsics import Intrinsics
from splatbus_wire.intrinsics import Pinhole

focal = st.floats(1, 1e4)
principal = st.floats(-1e4, 1e4)
sizes = st.integers(1, 32768)
pinholes = st.builds(Pinhole, focal, focal, principal, principal, sizes, sizes)
coordinates = st.floats(-1e3, 1e3)
points = st.lists(st.tuples(coordinates, coordinates, st.floats(0.01, 1e3)), max_size=4)
some = settings(deadline=None, max_examples=100)


def ulps(got, expected):
    return abs(got - float(expected)) / math.ulp(float(expected))


@some
@given(pinholes, sizes, sizes, coordinates, coordinates, points)
def test_what_follows_from_a_lens_is_as_exact_as_doubles_allow(
    pinhole, width, height, u, v, points
):
    exact = Intrinsics(*pinhole)
    scaled, ray = pinhole.scaled_to(width, height), pinhole.ray(u, v)
    assert max(map(ulps, scaled[:4], exact.scaled(width, height)[:4])) <= 2
    assert scaled[4:] == (width, height)
    assert max(map(ulps, ray.tolist(), exact.ray(u, v))) <= 2
    assert ray[2] == 1
    image_points = pinhole.project(np.reshape(points, (-1, 3)))
    assert image_points.shape == (len(points), 2)
    for point, got in zip(points, image_points, strict=True):
        expected = [float(a) for a in exact.image_point(point)]
        terms = np.abs(expected) + np.abs(pinhole[2:4])
        assert (np.abs(got - expected) <= 4e-16 * terms + 1e-300).all()


@pytest.mark.parametrize("z", [0.0, -0.0, -1.0, math.nan, -math.inf])
def test_what_is_not_ahead_has_no_image_point(z):
    image_points = Pinhole(300, 300, 160, 120, 320, 240).project([[1, 2, z], [0, 0, 4]])
    assert np.isnan(image_points[0]).all()
    assert image_points[1].tolist() == [160, 120]
