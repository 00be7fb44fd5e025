"""What may be sent, as values: what needs what, and what is left of it without."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.outgoing import (
    checked,
    checked_request,
    needs,
    only_1_1,
    permitted,
)
from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    CameraPose,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Intrinsics,
    ObjectPose,
    Ping,
    PointCloudPose,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
)
from splatbus_wire.poses import Pose

from tests.peers.fake_server import LENS, MESSAGE_CAPABILITIES, POSITION, ROTATION

POSE = Pose(POSITION, ROTATION)
INTRINSICS = Intrinsics(**LENS)
ALL = frozenset(MESSAGE_CAPABILITIES)
NEEDS = [
    (CameraPose(POSE, 0.0), None),
    (CameraPose(POSE, 0.0, "tag"), None),
    (CameraPose(POSE, 0.0, "tag", INTRINSICS), "intrinsics"),
    (ObjectPose("default", POSE), None),
    (ObjectPose("default", POSE, 2.0), "objects"),
    (ObjectPose("chair", POSE), "objects"),
    (SetTime(1.0), "time"),
    (SubscribeTelemetry(None), "telemetry"),
    (GetViewportSize(), None),
    (GetCameraPose(0), None),
    (GetScene(), "scene"),
    (SetViewport(4, 3), "viewport"),
    (Ping(0.0), "ping"),
]
TOLD = [message for message, _ in NEEDS if not hasattr(message, "id")]


@pytest.mark.parametrize(("message", "capability"), NEEDS)
def test_each_message_needs_its_capability(message, capability):
    assert needs(message) == capability


def test_what_1_0_knows_is_only_plain_poses_and_its_two_requests():
    known = [message for message, _ in NEEDS if not only_1_1(message)]
    assert known == [
        CameraPose(POSE, 0.0),
        ObjectPose("default", POSE),
        GetViewportSize(),
        GetCameraPose(0),
    ]


@pytest.mark.parametrize("message", TOLD)
@given(st.sets(st.sampled_from(MESSAGE_CAPABILITIES)))
def test_nothing_that_was_not_agreed_is_left(message, capabilities):
    sent = permitted(message, "1.1", capabilities)
    if sent is not None and not isinstance(sent, PointCloudPose):
        assert needs(sent) in {None, *capabilities}


@pytest.mark.parametrize("message", TOLD)
def test_to_1_0_go_poses_as_it_knows_them(message):
    sent = permitted(message, "1.0", frozenset())
    assert sent in (None, CameraPose(POSE, 0.0), PointCloudPose(POSE))
    assert (sent is None) == (needs(message) in {"objects", "time", "telemetry"})


@pytest.mark.parametrize("message", TOLD)
def test_what_was_agreed_is_sent_whole(message):
    sent = permitted(message, "1.1", ALL)
    assert sent == (PointCloudPose(POSE) if message == ObjectPose("default", POSE) else message)


@pytest.mark.parametrize(
    ("message", "requirement"),
    [
        (CameraPose(POSE._replace(rotation=(0.0, 0.0, 0.0, 0.0))), "POS-3"),
        (CameraPose(POSE._replace(rotation=(0.0, 0.0, 0.0, math.nan))), "POS-3"),
        (CameraPose(POSE._replace(position=(1e39, 0.0, 0.0))), "POS-2"),
        (CameraPose(POSE._replace(position=(math.nan, 0.0, 0.0))), "POS-2"),
        (CameraPose(POSE, 0.0, ""), "CAM-1"),
        (CameraPose(POSE, 0.0, "x" * 65), "CAM-1"),
        (CameraPose(POSE, 0.0, "\ud800"), "JSN-1"),
        (CameraPose(POSE, 0.0, None, INTRINSICS._replace(fx=0.0)), "CAM-4"),
        (CameraPose(POSE, 0.0, None, INTRINSICS._replace(cx=1e39)), "CAM-4"),
        (CameraPose(POSE, 0.0, None, INTRINSICS._replace(cx=math.nan)), "CAM-4"),
        (CameraPose(POSE, 0.0, None, INTRINSICS._replace(near=100.0)), "CAM-4"),
        (CameraPose(POSE, 0.0, None, INTRINSICS._replace(width=1.5)), "CAM-4"),
        (CameraPose(POSE, 0.0, None, INTRINSICS._replace(height=40000)), "CAM-4"),
        (ObjectPose("", POSE), "OBJ-1"),
        (ObjectPose("x" * 65, POSE), "OBJ-1"),
        (ObjectPose("a", POSE, 0.0), "OBJ-1"),
        (ObjectPose("a", POSE, -1.0), "OBJ-1"),
        (ObjectPose("a", POSE, math.nan), "OBJ-1"),
        (ObjectPose("a", POSE, 1.1e6), "OBJ-1"),
        (ObjectPose("a", POSE._replace(position=(math.inf, 0, 0))), "POS-2"),
        (SetTime(math.inf), "TIM-1"),
        (SubscribeTelemetry(frozenset([""])), "TEL-1"),
        (SubscribeTelemetry(frozenset(map(str, range(257)))), "TEL-1"),
    ],
)
def test_what_its_receiver_would_refuse_is_refused(message, requirement):
    with pytest.raises(ProtocolError) as caught:
        checked(message)
    assert caught.value.requirement == requirement


@pytest.mark.parametrize(
    ("request_", "requirement"),
    [
        (GetCameraPose(2**53), "REQ-2"),
        (GetCameraPose(0.5), "REQ-2"),
        (SetViewport(0, 1), "VPT-1"),
        (SetViewport(1, 32769), "VPT-1"),
        (SetViewport(1.5, 1), "VPT-1"),
        (Ping(math.nan), "PNG-1"),
    ],
)
def test_a_request_that_may_not_be_sent_is_refused(request_, requirement):
    with pytest.raises(ProtocolError) as caught:
        checked_request(request_)
    assert caught.value.requirement == requirement


def test_numbers_may_come_as_numpy_has_them():
    lens = Intrinsics(*np.float32(tuple(LENS.values())))
    plain = checked(CameraPose(POSE, 0.0, "a", lens)).intrinsics
    assert [type(number) for number in plain] == [float] * 4 + [int] * 2 + [float] * 2
    assert checked(ObjectPose("a", POSE, np.float32(0.5))).scale == 0.5
    assert type(checked(SetTime(np.float32(1.5))).time) is float


def test_the_extremes_may_be_sent():
    for scale in (LIMITS["min_scale"], LIMITS["max_scale"]):
        assert checked(ObjectPose("x" * 64, POSE, scale)).scale == scale
    assert checked_request(SetViewport(1, 32768)) == SetViewport(1, 32768)
