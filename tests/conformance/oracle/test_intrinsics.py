import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from splatbus_conformance.oracle import rotation_matrix, view_matrix
from splatbus_conformance.oracle.intrinsics import Intrinsics, from_opencv
from splatbus_conformance.oracle.rotations import apply

focal = st.floats(1, 1e4)
principal = st.floats(-1e4, 1e4)
sizes = st.integers(1, 32768)
cameras = st.builds(Intrinsics, focal, focal, principal, principal, sizes, sizes)
coordinates = st.floats(-1e3, 1e3)
ahead = st.tuples(coordinates, coordinates, st.floats(0.01, 1e3))
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
@given(cameras, ahead)
def test_distance_along_the_ray_times_its_cosine_is_planar_depth(camera, point):
    with mpmath.workprec(500):
        distance = mpmath.sqrt(sum(mpmath.mpf(a) ** 2 for a in point))
        exact = Fraction(*mpmath.libmp.to_rational(distance._mpf_))
        depth = camera.planar(*camera.image_point(point), exact)
    assert abs(depth - Fraction(point[2])) < Fraction(point[2]) / 2**380


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


def test_the_edges_of_the_image_are_at_one_and_minus_one():
    camera = Intrinsics(100, 100, 3, 2, 7, 5)
    assert camera.device_point(0, 0) == (-1, 1)
    assert camera.device_point(7, 5) == (1, -1)
    assert camera.device_point(3.5, 2.5) == (0, 0)


@pytest.mark.parametrize("z", [0, -1, -5e-324])
def test_what_is_not_ahead_has_no_image_point(z):
    assert Intrinsics(100, 100, 3, 2, 7, 5).image_point((1, 1, z)) is None


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
    assert Intrinsics(100, 100, 3, 2, 7, 5).pixel(u, v) == pixel


quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


@some
@given(cameras, st.tuples(*[coordinates] * 3), quaternions, ahead)
def test_the_whole_way_to_the_image_is_that_of_scipy(camera, position, q, point):
    world = np.array(apply(rotation_matrix(q), tuple(map(Fraction, point))), float) + position
    exactly = apply(view_matrix(position, q), (*map(Fraction, world), Fraction(1)))
    x, y, z = Rotation.from_quat(q).inv().apply(world - np.array(position))
    if z > 0.005:
        expected = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        got = [float(a) for a in camera.image_point(exactly[:3])]
        assert got == pytest.approx(expected, rel=1e-7, abs=1e-5)
