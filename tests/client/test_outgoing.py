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
from tests.wire.payloads import refusal

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
def test_of_a_message_goes_what_was_agreed_and_to_1_0_what_it_knows(message, capabilities):
    sent = permitted(message, "1.1", capabilities)
    if sent is not None and not isinstance(sent, PointCloudPose):
        assert needs(sent) in {None, *capabilities}
    whole = permitted(message, "1.1", ALL)
    assert whole == (PointCloudPose(POSE) if message == ObjectPose("default", POSE) else message)
    sent = permitted(message, "1.0", frozenset())
    assert sent in (None, CameraPose(POSE, 0.0), PointCloudPose(POSE))
    assert (sent is None) == (needs(message) in {"objects", "time", "telemetry"})


@pytest.mark.parametrize(
    ("check", "message", "requirement"),
    [
        *(
            (checked, CameraPose(POSE._replace(rotation=(0.0, 0.0, 0.0, w))), "POS-3")
            for w in (0.0, math.nan)
        ),
        *(
            (checked, ObjectPose("a", POSE._replace(position=(x, 0.0, 0.0))), "POS-2")
            for x in (1e39, math.nan, math.inf)
        ),
        *((checked, CameraPose(POSE, 0.0, tag), "CAM-1") for tag in ("", "x" * 65)),
        (checked, CameraPose(POSE, 0.0, "\ud800"), "JSN-1"),
        *(
            (checked, CameraPose(POSE, 0.0, None, INTRINSICS._replace(**change)), "CAM-4")
            for change in (
                *({"fx": 0.0}, {"cx": 1e39}, {"cx": math.nan}, {"near": 100.0}),
                *({"width": 1.5}, {"height": 40000}),
            )
        ),
        *((checked, ObjectPose(name, POSE), "OBJ-1") for name in ("", "x" * 65)),
        *(
            (checked, ObjectPose("a", POSE, scale), "OBJ-1")
            for scale in (0.0, -1.0, math.nan, 1.1e6)
        ),
        (checked, SetTime(math.inf), "TIM-1"),
        (checked, SubscribeTelemetry(frozenset([""])), "TEL-1"),
        (checked, SubscribeTelemetry(frozenset(map(str, range(257)))), "TEL-1"),
        (checked_request, GetCameraPose(2**53), "REQ-2"),
        (checked_request, GetCameraPose(0.5), "REQ-2"),
        (checked_request, SetViewport(0, 1), "VPT-1"),
        (checked_request, SetViewport(1, 32769), "VPT-1"),
        (checked_request, SetViewport(1.5, 1), "VPT-1"),
        (checked_request, Ping(math.nan), "PNG-1"),
    ],
)
def test_what_its_receiver_would_refuse_is_refused(check, message, requirement):
    assert refusal(check, message).requirement == requirement


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
