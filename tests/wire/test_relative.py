import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, target
from hypothesis import strategies as st
from splatbus_conformance import oracle
from splatbus_schemas import LIMITS
from splatbus_wire.poses import Pose, as_array, view_matrix
from splatbus_wire.relative import (
    camera_in_object,
    object_to_camera,
    relative_view,
    two_floats,
)

from tests.wire.stress import positions, quaternions

stress = settings(deadline=None, max_examples=100)
poses = st.builds(Pose, positions, quaternions())
scales = st.sampled_from([1.0, 2.0]) | st.floats(LIMITS["min_scale"], LIMITS["max_scale"])
TURNED = Pose((3.0, -1.0, 2.0), (-0.1, 0.2, -0.3, 0.9273618495495703))


def exact_eye(camera, points, origin):
    offset = [a - b for a, b in zip(map(Fraction, camera.position), points.position, strict=True)]
    there = (-a for a in oracle.view_translation(offset, points.rotation))
    return [a - Fraction(b) for a, b in zip(there, origin, strict=True)], offset


def budget(offset, origin):
    """What the docstring grants the camera's centre, in units of the scene."""
    lengths = oracle.norm(offset) + oracle.norm(oracle.exact(origin))
    return oracle.to_double(16 * oracle.U * lengths)


@stress
@given(poses, poses, positions, scales)
def test_the_camera_in_an_object_is_within_16u(camera, points, origin, scale):
    """[OBJ-1]: Rᵀ·(c − p)/s − origin."""
    at_no_origin, offset = exact_eye(camera, points, (0.0, 0.0, 0.0))
    expected = [
        a / Fraction(scale) - Fraction(b) for a, b in zip(at_no_origin, origin, strict=True)
    ]
    got = camera_in_object(camera, points, origin, scale)
    if scale == 1:
        assert camera_in_object(camera, points, origin) == got
    off = oracle.norm([a - b for a, b in zip(map(Fraction, got), expected, strict=True)])
    allowed = budget([a / Fraction(scale) for a in offset], origin)
    target(float(off) / allowed if allowed else 0.0)
    assert float(off) <= allowed


@stress
@given(poses, poses, positions, scales)
def test_scale_is_in_the_matrix(camera, points, origin, scale):
    """[OBJ-1, OBJ-6]: so that depth comes out in units of the world."""
    near = Pose(points.position, camera.rotation)
    plain = as_array(object_to_camera(near, points))[:3]
    scaled = as_array(object_to_camera(near, points, scale=scale))[:3]
    np.testing.assert_allclose(scaled, scale * plain, rtol=1e-15, atol=1e-15 * scale)
    counted = as_array(object_to_camera(near, points, origin, scale))[:3]
    # Numbers below 1e-300 have, or are made of some that have, less than 16 digits.
    tolerance = 1e-14 * scale * math.hypot(*origin) + 1e-300
    np.testing.assert_allclose(
        counted[:, 3], scaled[:, :3] @ origin + scaled[:, 3], rtol=0, atol=tolerance
    )
    moved, matrix = relative_view([[1.0, 2.0, 3.0]], camera, points, origin, scale)
    there = as_array(object_to_camera(camera, points, scale=scale), np.float32)
    np.testing.assert_array_equal(matrix[:3, :3], there[:3, :3])
    eye = np.array(camera_in_object(camera, points, origin, scale))
    assert (moved[0] == ((1.0, 2.0, 3.0) - eye).astype(np.float32)).all()


@stress
@given(poses, poses, positions, positions, st.sampled_from([np.float32, np.float64]))
def test_a_relative_point_is_rounded_once(camera, points, origin, point, dtype):
    """[ACC-6]: half an ULP of single precision, and what the camera's centre is off by."""
    given_points = np.array([point], dtype)
    expected, offset = exact_eye(camera, points, origin)
    moved, _ = relative_view(given_points, camera, points, origin)
    allowed = budget(offset, origin)
    for got, x, eye in zip(moved[0].tolist(), given_points[0].tolist(), expected, strict=True):
        exact = oracle.to_double(Fraction(x) - eye)
        # The difference is a double before it is a single.
        half_ulp = 0.5 * float(np.spacing(np.float32(abs(exact)))) * (1 + 2**-28)
        assert abs(got - exact) <= half_ulp + allowed


@stress
@given(poses)
def test_an_object_that_is_not_moved_is_seen_by_the_view_matrix(camera):
    assert object_to_camera(camera) == view_matrix(camera)


@stress
@given(positions, positions)
def test_two_floats_do_for_a_renderer_without_doubles(eye, point):
    high, low = two_floats(eye)
    assert high.dtype == low.dtype == np.float32
    together = high.astype(np.float64) + low
    tiny = float(np.finfo(np.float32).smallest_subnormal)
    assert (np.abs(together - eye) <= 2.0**-48 * np.abs(eye) + tiny).all()
    x = np.array(point, np.float32)
    moved = (x - high) - low
    exact = x.astype(np.float64) - together
    room = np.spacing(np.maximum(np.abs(exact), np.abs(np.spacing(high))).astype(np.float32))
    assert (np.abs(moved - exact) <= room).all()


def test_memory_can_be_given():
    points = np.array([[1, 2, 3]], np.float32)
    out = np.empty_like(points)
    assert relative_view(points, TURNED, out=out).points is out
    assert out.tolist() == [[-2.0, 3.0, 1.0]]


@pytest.mark.parametrize("shape", [(3,), (2, 4), (0,), (1, 1, 3)])
def test_points_have_three_coordinates(shape):
    with pytest.raises(ValueError, match=r"not \(N, 3\)"):
        relative_view(np.zeros(shape), TURNED)


def test_memory_has_to_fit():
    with pytest.raises(ValueError, match="float64"):
        relative_view(np.zeros((2, 3)), TURNED, out=np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"\(1, 3\)"):
        relative_view(np.zeros((2, 3)), TURNED, out=np.zeros((1, 3), np.float32))
