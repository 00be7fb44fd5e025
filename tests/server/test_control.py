from __future__ import annotations

from splatbus_server.control import Control, Poses
from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    Intrinsics,
    ObjectPose,
    Placement,
    PointCloudPose,
    SetTime,
)
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


LENS = Intrinsics(100.0, 100.0, 32.0, 24.0, 64, 48, 0.1, 50.0)
OTHER = LENS._replace(fx=200.0)


def scene(*names: str) -> Poses:
    return Poses(IDENTITY, {name: Placement(name, IDENTITY) for name in ("default", *names)})


def test_intrinsics_stay_in_force_until_others_come() -> None:
    """[CAM-7]"""
    control = Control(scene())
    assert control.poses.intrinsics is None
    control.move("a", CameraPose(at(1.0), intrinsics=LENS))
    control.move("a", CameraPose(at(2.0)))
    assert (control.poses.camera, control.poses.intrinsics) == (at(2.0), LENS)
    control.move("a", CameraPose(at(3.0), intrinsics=OTHER))
    assert control.poses.intrinsics == OTHER


def test_intrinsics_and_time_go_with_their_connection() -> None:
    """[CTL-3]: camera and objects stay."""
    control = Control(scene("chair"))
    control.move("a", CameraPose(at(1.0), intrinsics=LENS))
    control.move("a", SetTime(0.5))
    control.move("a", ObjectPose("chair", at(2.0), 0.5))
    assert control.leave("a")
    placed = {"default": Placement("default", IDENTITY), "chair": Placement("chair", at(2.0), 0.5)}
    assert control.poses == Poses(at(1.0), placed, serial=1)
    assert control.holder is None


def test_who_gets_control_has_the_newest_of_each_kind_applied() -> None:
    """[CAM-7, CTL-3, OBJ-2]: intrinsics too that came with an earlier pose than the newest."""
    control = Control(scene("chair"))
    control.move("a", CameraPose(at(1.0), intrinsics=LENS))
    control.move("a", SetTime(0.5))
    control.move("a", ObjectPose("chair", at(9.0)))
    for waiting in (
        CameraPose(at(2.0), tag="early", intrinsics=OTHER),
        SetTime(1.0),
        ObjectPose("default", at(3.0), 2.0),
        PointCloudPose(at(4.0)),
        CameraPose(at(5.0), tag="late"),
        SetTime(1.5),
    ):
        assert not control.move("b", waiting)
    control.leave("a")
    placed = {"default": Placement("default", at(4.0)), "chair": Placement("chair", at(9.0))}
    assert control.poses == Poses(at(5.0), placed, OTHER, 1.5, "late", serial=2)
    assert control.holder == "b"


def test_a_point_cloud_pose_is_that_of_the_default_object_with_scale_1() -> None:
    """[OBJ-2]"""
    control = Control(scene("chair"))
    control.move("a", ObjectPose("default", at(1.0), 5.0))
    control.move("a", PointCloudPose(at(2.0)))
    assert control.poses.objects["default"] == Placement("default", at(2.0), 1.0)


def test_two_equal_poses_are_two() -> None:
    """[CAM-2]"""
    pose = CameraPose(at(1.0), tag="t")
    once = scene().moved_by(pose)
    assert once.moved_by(pose).serial == once.serial + 1
    assert once.moved_by(pose).look_alike(once)


def test_what_makes_another_image() -> None:
    """[IMG-10]"""
    start = scene("chair")
    same = start.moved_by(ObjectPose("chair", IDENTITY)).moved_by(CameraPose(IDENTITY, tag="t"))
    assert start.look_alike(same)
    for message in (
        CameraPose(IDENTITY, intrinsics=LENS),
        SetTime(0.0),
        ObjectPose("chair", IDENTITY, 2.0),
        ObjectPose("chair", at(1.0)),
    ):
        assert not start.look_alike(start.moved_by(message))
        assert not start.moved_by(message).look_alike(start)


def test_only_objects_that_were_moved_need_be_told_of() -> None:
    """[OBJ-7]"""
    poses = scene("chair", "table").moved_by(ObjectPose("chair", IDENTITY, 2.0))
    assert poses.moved_objects == (Placement("chair", IDENTITY, 2.0),)
    assert poses.moved_by(ObjectPose("chair", IDENTITY)).moved_objects == ()
