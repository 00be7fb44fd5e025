"""A pinhole: against a camera matrix and against itself."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.oracle.intrinsics import Intrinsics, from_opencv

focal = st.floats(1, 1e4)
principal = st.floats(-1e4, 1e4)
sizes = st.integers(1, 32768)
cameras = st.builds(Intrinsics, focal, focal, principal, principal, sizes, sizes)
coordinates = st.floats(-1e3, 1e3)
ahead = st.tuples(coordinates, coordinates, st.floats(0.01, 1e3))
SMALL = Intrinsics(100, 100, 3, 2, 7, 5)
some = settings(deadline=None, max_examples=60)


@some
@given(cameras, ahead)
def test_image_points_are_those_of_the_camera_matrix(camera, point):
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    u, v, w = K @ point
    got = [float(a) for a in camera.image_point(point)]
    assert got == pytest.approx([u / w, v / w], rel=1e-12, abs=1e-8)


@some
@given(cameras, ahead)
def test_the_ray_of_an_image_point_leads_back_to_the_point(camera, point):
    ray = camera.ray(*camera.image_point(point))
    assert tuple(Fraction(point[2]) * a for a in ray) == tuple(map(Fraction, point))


@some
@given(cameras, sizes, sizes, ahead)
def test_a_scaled_camera_sees_the_same_part_of_its_image(camera, width, height, point):
    u, v = camera.image_point(point)
    scaled = camera.scaled(width, height)
    assert scaled.image_point(point) == (u * width / camera.width, v * height / camera.height)
    assert scaled.device_point(*scaled.image_point(point)) == camera.device_point(u, v)
    assert scaled.scaled(camera.width, camera.height) == camera


@some
@given(cameras, ahead)
def test_opencv_counts_from_the_centre_of_the_first_pixel(calibration, point):
    u, v = calibration.image_point(point)
    half = Fraction(1, 2)
    assert from_opencv(calibration).image_point(point) == (u + half, v + half)


@pytest.mark.parametrize(
    ("u", "v", "pixel"),
    [
        (0, 0, (0, 0)),
        (0.5, 0.5, (0, 0)),
        (math.nextafter(7, 0), math.nextafter(5, 0), (6, 4)),
        (7, 2, None),
        (2, 5, None),
        (-5e-324, 2, None),
    ],
)
def test_a_pixel_has_its_left_and_upper_border(u, v, pixel):
    assert SMALL.pixel(u, v) == pixel


def test_the_edges_of_the_image_are_at_one_and_what_is_behind_is_nowhere():
    assert SMALL.device_point(0, 0) == (-1, 1)
    assert SMALL.device_point(7, 5) == (1, -1)
    assert SMALL.image_point((1, 1, 0)) is None
