from __future__ import annotations

from typing import Any

import pytest
from splatbus_server.control import Poses
from splatbus_wire.messages import CameraPose, Intrinsics, ObjectPose, Placement, SetTime
from splatbus_wire.poses import IDENTITY, Pose

LENS = Intrinsics(100.0, 100.0, 32.0, 24.0, 64, 48, 0.1, 50.0)
AT_REST = Poses(IDENTITY, {name: Placement(name, IDENTITY) for name in ("default", "chair")})

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
        ([ObjectPose("chair", TURNED)], False),
    ],
)
def test_what_makes_another_image(messages: list[Any], is_alike: bool) -> None:
    """[IMG-10]"""
    before = after = AT_REST.moved_by(CameraPose(TURNED))
    for message in messages:
        after = after.moved_by(message)
    assert before.look_alike(after) == after.look_alike(before) == is_alike
    assert after.serial - before.serial == sum(isinstance(m, CameraPose) for m in messages)
