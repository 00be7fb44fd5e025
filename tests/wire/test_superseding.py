"""What takes the place of what, among messages that steer."""

from __future__ import annotations

from splatbus_wire.messages import ObjectPose, PointCloudPose
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.superseding import subject

POSE = Pose((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))


def test_the_pose_of_1_0_is_about_the_default_object() -> None:
    """[OBJ-2]"""
    assert subject(PointCloudPose(POSE)) == subject(ObjectPose("default", IDENTITY))
    assert subject(PointCloudPose(POSE)) != subject(ObjectPose("chair", IDENTITY))
