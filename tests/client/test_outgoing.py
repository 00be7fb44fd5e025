"""What may be sent, as values."""

import math

import numpy as np
import pytest
from splatbus_client.outgoing import checked
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
    SetTime,
    SetViewport,
    SubscribeTelemetry,
    decode_from_client,
    encode,
)

from tests.peers.fake_server import LENS, POSE
from tests.wire.payloads import payload_of

INTRINSICS = Intrinsics(**LENS)
MESSAGES = [
    CameraPose(POSE, None, "tag", INTRINSICS),
    ObjectPose("chair", POSE, 2.0),
    SetTime(1.0),
    SubscribeTelemetry(None),
    SubscribeTelemetry(frozenset("ab")),
    GetViewportSize(),
    GetCameraPose(0),
    GetScene(),
    SetViewport(4, 3),
    Ping(0.0),
]


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
        yield from (LIMITS["min_scale"], LIMITS["max_scale"], 32768)
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


@pytest.mark.parametrize("message", MESSAGES)
def test_exactly_what_its_receiver_would_refuse_is_refused(message):
    for each in (message, *altered(message)):
        here, there = refused(checked, each), refused(received, each)
        assert (here is None) == (there is None), each
        assert here == there or there in ("JSN-1", "JSN-4"), each  # it cannot even be encoded


def test_numbers_may_come_as_numpy_has_them():
    lens = Intrinsics(*np.float32(tuple(LENS.values())))
    plain = checked(CameraPose(POSE, None, "a", lens)).intrinsics
    assert [type(number) for number in plain] == [float] * 4 + [int] * 2 + [float] * 2
    assert checked(ObjectPose("a", POSE, np.float32(0.5))).scale == 0.5
    assert type(checked(SetTime(np.float32(1.5))).time) is float
