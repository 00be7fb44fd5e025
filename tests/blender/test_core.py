"""Poses, lenses and time of the extension, without Blender."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splatbus_blender.core import lens, poses, timeline
from splatbus_blender.core.lens import Film, Optics
from splatbus_blender.core.poses import Placed
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import rotation_matrix

from tests.blender.running import ran

WIRE = Pose((1, -2, 5), (-0.1, 0.2, -0.3, math.sqrt(0.86)))
"""The worked example of section 7.3."""
CAMERA = (0.5850331743, -0.3535533906, 0.0707106781, 0.7264545305)


def test_a_camera_and_an_object_are_those_of_the_worked_example() -> None:
    pose = poses.camera_pose(Placed((1, 5, 2), CAMERA))
    assert pose.position == WIRE.position
    assert pose.rotation == pytest.approx(WIRE.rotation, abs=1e-9)
    placed = Placed((1, 5, 2), (-0.1, -0.3, -0.2, math.sqrt(0.86)), (2, 2, 2))
    assert poses.object_pose(placed) == (WIRE, 2.0)


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_angles_of_euler_turn_in_their_order(order: str) -> None:
    angles = (0.3, -1.2, 2.5)
    expected = np.eye(3)
    for name in order:
        i = "XYZ".index(name)
        j, k = (i + 1) % 3, (i + 2) % 3
        turn = np.eye(3)
        turn[j, j] = turn[k, k] = math.cos(angles[i])
        turn[k, j], turn[j, k] = math.sin(angles[i]), -math.sin(angles[i])
        expected = turn @ expected
    got = np.array(rotation_matrix(poses.from_euler(angles, order))).reshape(3, 3)
    np.testing.assert_allclose(got, expected, atol=1e-15)


def test_an_axis_without_length_turns_nothing() -> None:
    assert poses.from_axis_angle(1.0, (0, 0, 0)) == (0, 0, 0, 1)
    with pytest.raises(ValueError, match="zeros"):
        poses.unit_quaternion((0, 0, 0, 0))


def _rows(placed: Placed) -> Any:
    rows = np.eye(4)
    rows[:3, :3] = np.array(rotation_matrix(placed.rotation)).reshape(3, 3) * placed.scale
    rows[:3, 3] = placed.position
    return rows.tolist()


def test_a_matrix_says_what_it_was_made_of() -> None:
    placed = Placed((1, -20, 3), poses.unit_quaternion((0.1, 0.7, -0.3, 0.4)), (2, 0.5, 3))
    rows = _rows(placed)
    again = poses.from_matrix(rows)
    assert again.position == placed.position
    assert again.rotation == pytest.approx(placed.rotation, abs=1e-15)
    assert again.scale == pytest.approx(placed.scale, abs=1e-15)
    assert poses.agree(placed, np.array(rows, np.float32).tolist())
    rows[1][3] += 1e-4
    assert not poses.agree(placed, rows)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda m: m * [-1, 1, 1, 1], "reflection"),
        (lambda m: m * [0, 1, 1, 1], "no size"),
        (lambda m: m @ (np.eye(4) + np.eye(4, k=1) / 10), "not orthogonal"),
    ],
)
def test_what_no_pose_can_say_is_refused(spoil: Callable[..., np.ndarray], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        poses.from_matrix(spoil(np.eye(4)).tolist())


OPTICS = Optics(50, "AUTO", 36, 24, 0.0, 0.0, 0.1, 100)


def test_a_lens_in_pixels() -> None:
    wide = lens.camera_lens(OPTICS, Film(360, 240))
    assert wide == (500, 500, 180, 120, 360, 240, 0.1, 100)
    assert lens.camera_lens(OPTICS, Film(240, 360))[:4] == (500, 500, 120, 180)
    upright = OPTICS._replace(sensor_fit="VERTICAL")
    assert lens.camera_lens(upright, Film(360, 240))[:2] == (500, 500)
    flat = lens.camera_lens(OPTICS, Film(360, 240, 1, 2))
    assert flat == (500 * 4 / 3, 250 * 4 / 3, 180, 120, 360, 240, 0.1, 100)


def test_a_lens_for_images_of_another_shape_sees_the_same() -> None:
    one = lens.camera_lens(OPTICS._replace(shift_x=0.1), Film(360, 240))
    two = lens.for_images(one, 64, 48, unit=0.5)
    assert (two.width, two.height, two.near, two.far) == (64, 48, 0.2, 200)
    for x, y in ((0.1, 0.2), (-0.3, 0.1)):
        u, v = one.fx * x + one.cx, one.fy * y + one.cy
        assert two.fx * x + two.cx == pytest.approx(u * 64 / 360)
        assert two.fy * y + two.cy == pytest.approx(v * 48 / 240)


def test_frames_are_times() -> None:
    assert timeline.seconds(1, 1, 24, 1) == 0
    assert timeline.seconds(49.5, 1, 24, 1) == pytest.approx(48.5 / 24)
    assert timeline.seconds(31, 1, 30, 1.001) == pytest.approx(1.001)


def test_in_blender_they_are_what_blender_computes(tmp_path: Path) -> None:
    assert "check_lenses" in ran("core.py", tmp_path)
