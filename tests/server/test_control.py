from __future__ import annotations

from splatbus_server.control import Control, Poses
from splatbus_wire.messages import DEFAULT_OBJECT, CameraPose, Placement, PointCloudPose
from splatbus_wire.poses import IDENTITY, Pose


def at(x: float) -> Pose:
    return Pose((x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def moved(pose: Pose, scale: float = 1.0) -> dict[str, Placement]:
    return {DEFAULT_OBJECT: Placement(DEFAULT_OBJECT, pose, scale)}


def test_the_first_to_move_has_control() -> None:
    """[POS-11]"""
    control = Control(Poses(IDENTITY))
    assert control.move("a", CameraPose(at(1.0)))
    assert not control.move("b", CameraPose(at(2.0)))
    assert control.move("a", CameraPose(at(3.0)))
    assert control.poses.camera == at(3.0)


def test_one_kind_of_pose_leaves_the_other() -> None:
    """[POS-7, POS-13]"""
    control = Control(Poses(at(1.0)))
    control.move("a", PointCloudPose(at(2.0)))
    assert control.poses == Poses(at(1.0), moved(at(2.0)))
    control.move("a", CameraPose(at(3.0)))
    assert control.poses == Poses(at(3.0), moved(at(2.0)), serial=1)


def test_control_passes_to_the_next_with_what_it_has_sent() -> None:
    """[POS-11]"""
    control = Control(Poses(IDENTITY))
    control.move("a", CameraPose(at(1.0)))
    control.move("a", PointCloudPose(at(9.0)))
    control.move("c", CameraPose(at(3.0)))
    control.move("b", CameraPose(at(2.0)))
    assert control.leave("a")
    assert control.poses == Poses(at(3.0), moved(at(9.0)), serial=2)
    assert not control.move("b", CameraPose(at(4.0)))
    assert control.move("c", CameraPose(at(5.0)))


def test_who_leaves_without_control_changes_nothing() -> None:
    control = Control(Poses(IDENTITY))
    control.move("a", CameraPose(at(1.0)))
    control.move("b", CameraPose(at(2.0)))
    assert not control.leave("b")
    assert not control.leave("stranger")
    assert control.poses.camera == at(1.0)
    assert control.leave("a")
    assert control.poses.camera == at(1.0)


def test_a_quaternion_and_its_negative_look_alike() -> None:
    """[IMG-10]"""
    pose = Pose((1.0, 2.0, 3.0), (0.5, -0.5, 0.5, 0.5))
    opposite = Pose((1.0, 2.0, 3.0), (-0.5, 0.5, -0.5, -0.5))
    assert Poses(pose).look_alike(Poses(opposite))
    assert not Poses(pose).look_alike(Poses(pose, moved(pose)))
    assert not Poses(pose).look_alike(Poses(Pose((1.0, 2.0, 3.5), pose.rotation)))
    assert not Poses(pose).look_alike(Poses(Pose(pose.position, (0.5, -0.5, 0.5, -0.5))))
