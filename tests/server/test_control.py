from __future__ import annotations

from typing import Any

import pytest
from splatbus_server.control import Control, Poses
from splatbus_wire.messages import (
    CameraPose,
    Intrinsics,
    ObjectPose,
    Placement,
    PointCloudPose,
    SetTime,
)
from splatbus_wire.poses import IDENTITY, Pose

LENS = Intrinsics(100.0, 100.0, 32.0, 24.0, 64, 48, 0.1, 50.0)
OTHER = LENS._replace(fx=200.0)
AT_REST = Poses(IDENTITY, {name: Placement(name, IDENTITY) for name in ("default", "chair")})


def at(x: float) -> Pose:
    return Pose((x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def test_the_first_steers_and_then_the_next_with_the_newest_of_each_kind() -> None:
    """[POS-7, POS-11, POS-13, CAM-2, CAM-7, CTL-3, OBJ-2]"""
    control = Control(AT_REST)
    for who, message, camera, lens, time in (
        ("a", CameraPose(at(1.0), intrinsics=LENS), 1.0, LENS, None),
        ("a", CameraPose(at(2.0)), 2.0, LENS, None),
        ("a", SetTime(0.5), 2.0, LENS, 0.5),
        ("a", ObjectPose("chair", at(9.0), 0.5), 2.0, LENS, 0.5),
        ("b", CameraPose(at(2.5), tag="early", intrinsics=OTHER), 2.0, LENS, 0.5),
        ("b", SetTime(1.0), 2.0, LENS, 0.5),
        ("c", CameraPose(at(8.0)), 2.0, LENS, 0.5),
        ("b", ObjectPose("default", at(3.0), 2.0), 2.0, LENS, 0.5),
        ("b", PointCloudPose(at(4.0)), 2.0, LENS, 0.5),
        ("b", CameraPose(at(5.0), tag="late"), 2.0, LENS, 0.5),
        ("stranger", None, 2.0, LENS, 0.5),
        ("c", None, 2.0, LENS, 0.5),
        ("a", None, 5.0, OTHER, 1.0),
        ("b", CameraPose(at(5.0), tag="late"), 5.0, OTHER, 1.0),
        ("b", None, 5.0, None, None),
    ):
        if message is None:
            control.leave(who)
        else:
            assert control.move(who, message) == (who == control.holder)
        found = control.poses
        assert (found.camera, found.intrinsics, found.time) == (at(camera), lens, time), message
    placed = (Placement("default", at(4.0)), Placement("chair", at(9.0), 0.5))
    assert control.poses == Poses(
        at(5.0), {each.object: each for each in placed}, None, None, "late", serial=4
    )
    assert control.poses.moved_objects == placed
    assert control.holder is None


TURNED = Pose((1.0, 2.0, 3.0), (0.5, -0.5, 0.5, 0.5))


@pytest.mark.parametrize(
    ("messages", "is_alike"),
    [
        ([ObjectPose("chair", IDENTITY), CameraPose(TURNED, tag="t")], True),
        ([CameraPose(Pose(TURNED.position, (-0.5, 0.5, -0.5, -0.5)))], True),
        ([CameraPose(Pose(TURNED.position, (0.5, -0.5, 0.5, -0.5)))], False),
        ([CameraPose(Pose((1.0, 2.0, 3.5), TURNED.rotation))], False),
        ([CameraPose(TURNED, intrinsics=LENS)], False),
        ([SetTime(0.0)], False),
        ([ObjectPose("chair", IDENTITY, 2.0)], False),
        ([ObjectPose("chair", at(1.0))], False),
    ],
)
def test_what_makes_another_image(messages: list[Any], is_alike: bool) -> None:
    """[IMG-10]"""
    before = after = AT_REST.moved_by(CameraPose(TURNED))
    for message in messages:
        after = after.moved_by(message)
    assert before.look_alike(after) == after.look_alike(before) == is_alike
    assert after.serial - before.serial == sum(isinstance(m, CameraPose) for m in messages)
