from __future__ import annotations

import numpy as np
import pytest
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_wire.poses import IDENTITY, Pose

POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))


def view(camera: Pose, points: Pose = IDENTITY) -> View:
    return View(Poses(camera, points), field_of_view(4, 3), 4, 3, frozenset(("color",)), 1)


def test_the_worked_example_of_the_specification() -> None:
    """[CNV-1], chapter 7.3 of 1.0."""
    found = view(POSE).world_to_camera
    rotation = [
        [0.74, 0.51641711, 0.43094474],
        [-0.59641711, 0.8, 0.06547237],
        [-0.31094474, -0.30547237, 0.9],
    ]
    np.testing.assert_allclose(found[:3, :3], np.transpose(rotation), atol=5e-9)
    np.testing.assert_allclose(found[:3, 3], [-0.3781105, 2.6109447, -4.8], atol=5e-8)


def test_an_object_and_a_camera_that_move_together_look_the_same() -> None:
    np.testing.assert_allclose(view(POSE, POSE).object_to_camera, np.eye(4), atol=1e-15)
    np.testing.assert_allclose(
        view(POSE).object_to_camera, view(POSE).world_to_camera, rtol=1e-15, atol=1e-15
    )


def test_far_from_the_origin_what_is_near_the_camera_stays_near() -> None:
    """The centre is subtracted before rotating: 1 unit is 1 unit at 10¹⁵ too."""
    far = 1e15
    camera = Pose((far, far, -far), POSE.rotation)
    near = Pose((far + 1.0, far, -far), IDENTITY.rotation)
    offset = view(camera, near).object_to_camera[:3, 3]
    assert np.linalg.norm(offset) == pytest.approx(1.0, abs=1e-15)


def test_the_default_field_of_view() -> None:
    found = field_of_view(320, 240)
    assert found == pytest.approx(Intrinsics(207.846096908, 207.846096908, 160.0, 120.0))
