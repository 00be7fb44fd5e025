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
    decode_from_client,
    encode,
)
from splatbus_wire.poses import Pose

from tests.peers.fake_server import LENS, MESSAGE_CAPABILITIES, POSITION, ROTATION
from tests.wire.payloads import payload_of

POSE = Pose(POSITION, ROTATION)
INTRINSICS = Intrinsics(**LENS)
ALL = frozenset(MESSAGE_CAPABILITIES)
NEEDS = [
    (CameraPose(POSE), None),
    (CameraPose(POSE, None, "tag"), None),
    (CameraPose(POSE, None, "tag", INTRINSICS), "intrinsics"),
    (ObjectPose("default", POSE), None),
    (ObjectPose("default", POSE, 2.0), "objects"),
    (ObjectPose("chair", POSE), "objects"),
    (SetTime(1.0), "time"),
    (SubscribeTelemetry(None), "telemetry"),
    (SubscribeTelemetry(frozenset("ab")), "telemetry"),
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
        CameraPose(POSE),
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
    assert sent in (None, CameraPose(POSE), PointCloudPose(POSE))
    assert (sent is None) == (needs(message) in {"objects", "time", "telemetry"})


def altered(value):
    """A message with each number, text or set in it replaced in many ways."""
    if isinstance(value, tuple):
        for place, inner in enumerate(value):
            for other in altered(inner):
                parts = (*value[:place], other, *value[place + 1 :])
                yield value._make(parts) if hasattr(value, "_make") else parts
    elif isinstance(value, str):
        yield from ("", "x" * 64, "x" * 65, "\ud800")
    elif isinstance(value, frozenset):
        yield from (
            frozenset([""]),
            frozenset(map(str, range(256))),
            frozenset(map(str, range(257))),
        )
    elif value is not None:
        yield from (0.0, -1.0, 1.5, 0.99, 100.0, 1.1e6, 40_000, 2**53, 1e39, math.nan, math.inf)


def refused(call, *arguments):
    """The requirement that is broken; None if the call is done."""
    try:
        call(*arguments)
    except ProtocolError as error:
        return error.requirement
    return None


def received(message):
    return decode_from_client(payload_of(encode(message)), "msg", said_hello=True)


@pytest.mark.parametrize("message", [message for message, _ in NEEDS])
def test_exactly_what_its_receiver_would_refuse_is_refused(message):
    check = checked_request if hasattr(message, "id") else checked
    for each in (message, *altered(message)):
        here, there = refused(check, each), refused(received, each)
        assert (here is None) == (there is None), each
        assert here == there or there in ("JSN-1", "JSN-4"), each  # it cannot even be encoded


def test_numbers_may_come_as_numpy_has_them():
    lens = Intrinsics(*np.float32(tuple(LENS.values())))
    plain = checked(CameraPose(POSE, None, "a", lens)).intrinsics
    assert [type(number) for number in plain] == [float] * 4 + [int] * 2 + [float] * 2
    assert checked(ObjectPose("a", POSE, np.float32(0.5))).scale == 0.5
    assert type(checked(SetTime(np.float32(1.5))).time) is float


def test_the_extremes_may_be_sent():
    for scale in (LIMITS["min_scale"], LIMITS["max_scale"]):
        assert checked(ObjectPose("x" * 64, POSE, scale)).scale == scale
    assert checked_request(SetViewport(1, 32768)) == SetViewport(1, 32768)
