"""Camera poses as a person writes them."""

import math
from argparse import ArgumentTypeError

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_viewer.poses import look_at, parse_look_at, parse_pose, same_view
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import rotation_matrix

POINTS = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


def test_a_pose_is_position_then_quaternion():
    assert parse_pose(" 1, -2,3e0,0,0,0,1") == Pose((1.0, -2.0, 3.0), (0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    "text", ["", "1,2,3", "1,2,3,4,5,6,7,8", "a,2,3,4,5,6,7", "nan,2,3,4,5,6,7"]
)
def test_what_is_no_pose_is_refused(text):
    with pytest.raises(ValueError, match=r"float|7 finite"):
        parse_pose(text)


@given(POINTS, POINTS)
def test_the_target_is_ahead_and_the_camera_upright(eye, target):
    distance = math.dist(eye, target)
    if distance < 1e-6:
        return
    pose = look_at(eye, target)
    matrix = rotation_matrix(pose.rotation)
    forward = [(t - e) / distance for e, t in zip(eye, target, strict=True)]
    assert [matrix[2], matrix[5], matrix[8]] == pytest.approx(forward, abs=1e-9)
    right_y, down_y = matrix[3], matrix[4]
    assert right_y == pytest.approx(0.0, abs=1e-12), "the horizon is level"
    assert down_y >= -1e-12, "and not upside down"


def test_an_eye_on_its_target_is_refused():
    with pytest.raises(ArgumentTypeError, match="1,2,3,1,2,3': the eye and the point to look"):
        parse_look_at("1,2,3,1,2,3")


def test_a_view_is_the_same_whatever_the_sign_and_length_of_its_quaternion():
    pose = look_at((1.0, 2.0, 3.0), (0.0, 0.0, 4.0))
    other = pose._replace(rotation=tuple(-1.001 * q for q in pose.rotation))
    assert same_view(pose, other)


@pytest.mark.parametrize("target", [(1e-3, 0.0, 4.0), (0.0, 1e-3, 4.0)])
def test_a_view_is_another_where_a_pixel_would_move(target):
    straight = look_at((0.0, 0.0, 0.0), (0.0, 0.0, 4.0))
    assert not same_view(straight, look_at((0.0, 0.0, 0.0), target))
    assert not same_view(straight, straight._replace(position=(1e-5, 0.0, 0.0)))
