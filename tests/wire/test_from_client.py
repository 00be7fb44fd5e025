"""What is wrong with a client's message: code, requirement and pointer, where no schema can say."""

import pytest
from splatbus_schemas import examples
from splatbus_wire.messages import (
    CameraPose,
    Intrinsics,
    ObjectPose,
    Pose,
    SubscribeTelemetry,
    decode_from_client,
)

from tests.wire.payloads import payload, refusal

POSE = {
    "type": "camera_pose",
    "position": {"x": 0.0, "y": 0.0, "z": 0.0},
    "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
}
LENS = {
    "fx": 300.0, "fy": 300.0, "cx": 160.0, "cy": 120.0,
    "width": 320, "height": 240, "near": 0.01, "far": 100.0,
}  # fmt: skip


def after_welcome(message: object):
    return decode_from_client(payload(message), "msg", said_hello=True)


def refused(message: object) -> tuple[str, str, str | None]:
    error = refusal(after_welcome, message)
    return error.code, error.requirement, error.pointer


@pytest.mark.parametrize(
    ("change", "code", "pointer"),
    [
        ({"near": 100.0}, "invalid_message", "/intrinsics/far"),
        ({"near": 100.5}, "invalid_message", "/intrinsics/far"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(change, code, pointer):
    message = POSE | {"intrinsics": LENS | change}
    assert refused(message) == (code, "CAM-4", pointer)


def test_before_hello_a_camera_has_neither_tag_nor_intrinsics():
    message = POSE | {"tag": 1, "intrinsics": {"fx": "wide"}}
    found = decode_from_client(payload(message), "msg", said_hello=False)
    assert found == CameraPose(Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    assert refused(message) == ("invalid_message", "CAM-1", "/tag")


def test_a_lens_is_taken_beside_another_order_of_members():
    message = {"intrinsics": LENS, "tag": "a"} | POSE
    assert after_welcome(message) == CameraPose(
        Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), None, "a", Intrinsics(**LENS)
    )


@pytest.mark.parametrize(
    ("change", "code", "requirement", "pointer"),
    [
        ({"position": {"x": 1e39, "y": 0, "z": 0}}, "invalid_number", "POS-2", "/position/x"),
        ({"rotation": POSE["rotation"] | {"w": 1.011}}, "invalid_rotation", "POS-3", "/rotation"),
    ],
)
def test_a_broken_pose_of_an_object_is_refused(change, code, requirement, pointer):
    message = POSE | {"type": "object_pose", "object": "chair"}
    assert after_welcome(message) == ObjectPose(
        "chair", Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 1.0
    )
    assert refused(message | change) == (code, requirement, pointer)


def test_all_series_are_not_the_same_as_none():
    every, none = (
        after_welcome({"type": "subscribe_telemetry", "names": names}) for names in (None, [])
    )
    assert (every, none) == (SubscribeTelemetry(None), SubscribeTelemetry(frozenset()))


@pytest.mark.parametrize(
    "name", "object_pose set_time get_scene set_viewport ping subscribe_telemetry".split()
)
def test_before_hello_the_new_types_are_unknown(name):
    for example in examples(name, "1.1")[0]:
        error = refusal(decode_from_client, payload(example.message), "msg", said_hello=False)
        assert (error.code, error.requirement) == ("unknown_type", "REQ-8")
