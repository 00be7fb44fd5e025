"""What takes the place of what, among messages that steer."""

from __future__ import annotations

from splatbus_wire.messages import CameraPose, Intrinsics, ObjectPose, PointCloudPose, SetTime
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.superseding import subject, succeeding

POSE = Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
LENS = Intrinsics(300.0, 300.0, 160.0, 120.0, 320, 240, 0.01, 100.0)


def test_each_object_is_a_subject_of_its_own() -> None:
    assert subject(ObjectPose("a", POSE)) == subject(ObjectPose("a", IDENTITY, 2.0))
    assert subject(ObjectPose("a", POSE)) != subject(ObjectPose("b", POSE))
    assert subject(CameraPose(POSE)) != subject(SetTime(1.0))


def test_the_pose_of_1_0_is_about_the_default_object() -> None:
    """[OBJ-2]"""
    assert subject(PointCloudPose(POSE)) == subject(ObjectPose("default", IDENTITY))
    assert subject(PointCloudPose(POSE)) != subject(ObjectPose("chair", IDENTITY))


def test_a_pose_without_a_lens_leaves_the_former_in_force() -> None:
    """[CAM-7]"""
    former, message = CameraPose(POSE, 0.0, "a", LENS), CameraPose(IDENTITY, 1.0, "b")
    assert succeeding(former, message) == CameraPose(IDENTITY, 1.0, "b", LENS)
    other = message._replace(intrinsics=LENS._replace(fx=1.0))
    assert succeeding(former, other) == other
    assert succeeding(None, message) == message
