"""What is wrong with a server's message: code, requirement and pointer, where no schema can say."""

import copy
from typing import Any

import pytest
from splatbus_schemas import examples
from splatbus_wire.messages import (
    CameraReply,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Ping,
    Pong,
    Scalar,
    SetViewport,
    Telemetry,
    Text,
    ViewportSize,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
)

from tests.wire.payloads import payload, payload_of, refusal

REQUESTS = {"scene": GetScene(9), "telemetry": None, "camera": GetCameraPose(0)}


def example(name: str, containing: str = "") -> Any:
    """A message of which a test may change anything."""
    valid, _ = examples(name, "1.1")
    return copy.deepcopy(next(each.message for each in valid if containing in each.why))


def changed(message: Any, pointer: str, value: object) -> Any:
    *path, last = (int(step) if step.isdigit() else step for step in pointer[1:].split("/"))
    place = message
    for step in path:
        place = place[step]
    place[last] = value
    return message


def refused(name: str, message: Any) -> tuple[str, str, str | None]:
    error = refusal(decode_from_server_message, payload(message), REQUESTS[name])
    return error.code, error.requirement, error.pointer


@pytest.mark.parametrize(
    ("pointer", "value", "code", "requirement", "at"),
    [
        ("/objects/1/id", "default", "invalid_message", "SCN-2", "/objects"),
        ("/objects/0/id", "garden", "invalid_message", "SCN-2", "/objects"),
        ("/objects/0/bounds/min/2", 4.5, "invalid_message", "SCN-2", "/objects/0/bounds"),
        ("/timeRange/1", -2.0, "invalid_message", "SCN-2", "/timeRange"),
        ("/cameras", True, "invalid_message", "SCN-2", "/cameras"),
    ],
)
def test_a_scene_that_cannot_be_is_refused(pointer, value, code, requirement, at):
    message = example("scene", "animated") | {"id": 9}
    decode_from_server_message(payload(message), GetScene(9))
    assert refused("scene", changed(message, pointer, value)) == (code, requirement, at)


@pytest.mark.parametrize(
    ("pointer", "value", "code", "at"),
    [
        ("/series/1/name", "render_ms", "invalid_message", "/series"),
        ("/series/1/edges", [0.0, 0.5, 0.5], "invalid_message", "/series/1/edges"),
        ("/series/1/edges", [0.0, 1.0, 0.5], "invalid_message", "/series/1/edges"),
        ("/series/1/counts", [1000], "invalid_message", "/series/1/counts"),
        ("/series/1/counts", [1, 2, 3], "invalid_message", "/series/1/counts"),
        ("/series/0/value", True, "invalid_message", "/series/0/value"),
        ("/series/0/kind", 1, "invalid_message", "/series/0/kind"),
    ],
)
def test_telemetry_that_cannot_be_is_refused(pointer, value, code, at):
    message = changed(example("telemetry"), pointer, value)
    assert refused("telemetry", message) == (code, "TEL-2", at)


@pytest.mark.parametrize("kind", ["heat_map", "", "k" * 1000])
def test_a_series_of_an_unknown_kind_is_left_out(kind):
    message = changed(example("telemetry"), "/series/1", {"name": "x", "kind": kind, "value": []})
    assert decode_from_server_message(payload(message), None) == Telemetry(
        17, 1041.25, (Scalar("render_ms", 3.5, "ms"), Text("stage", "training"))
    )


@pytest.mark.parametrize(
    ("change", "code", "requirement", "pointer"),
    [
        ({"fx": 9.9e-7}, "invalid_message", "CAM-4", "/intrinsics/fx"),
        ({"near": 100.0}, "invalid_message", "CAM-4", "/intrinsics/far"),
    ],
)
def test_a_camera_with_a_lens_that_cannot_be_is_refused(change, code, requirement, pointer):
    message = example("camera", "with intrinsics")
    message["intrinsics"] |= change
    assert refused("camera", message) == (code, requirement, pointer)


def test_a_reply_of_1_0_has_no_intrinsics():
    message = example("camera", "with intrinsics")
    with_lens = decode_from_server_message(payload(message), GetCameraPose(0))
    assert isinstance(with_lens, CameraReply)
    assert with_lens.intrinsics is not None
    del message["type"]
    message["intrinsics"] = "none"
    reply = decode_from_server_message(payload(message), GetCameraPose(0))
    assert reply == with_lens._replace(intrinsics=None)


@pytest.mark.parametrize("name", ["scene", "pong"])
def test_the_new_replies_have_a_type(name):
    message, request = example(name), {"scene": GetScene(9), "pong": Ping(12.5, 5)}[name]
    decode_from_server_message(payload(message), request)
    del message["type"]
    error = refusal(decode_from_server_message, payload(message), request)
    assert (error.code, error.pointer) == ("unknown_type", "/type")


def test_a_size_answers_whoever_asked_for_one():
    reply = payload_of(encode(ViewportSize(640, 480, 12), typed_replies=True))
    for request in (GetViewportSize(12), SetViewport(640, 480, 12)):
        assert decode_from_server_message(reply, request) == ViewportSize(640, 480, 12)


def test_a_reply_to_another_kind_of_request_is_refused():
    reply = payload_of(encode(Pong(1.0, 2.0, 5), typed_replies=True))
    error = refusal(decode_from_server_message, reply, GetScene(5))
    assert (error.code, error.requirement) == ("invalid_message", "REQ-7")
    error = refusal(decode_from_server_message, reply, Ping(1.0, 6))
    assert (error.requirement, error.pointer) == ("NEG-28", "/id")


@pytest.mark.parametrize(
    ("pointer", "value", "code", "requirement", "at"),
    [
        ("/camera/tag", "", "invalid_message", "CAM-3", "/camera/tag"),
        ("/objects/0/object", "default", "invalid_message", "OBJ-7", "/objects"),
        ("/objects/0/position/0", 1e39, "invalid_number", "POS-2", "/objects/0/position/0"),
        ("/objects/0/rotation/3", 1.011, "invalid_rotation", "POS-3", "/objects/0/rotation"),
        ("/objects/0/scale", 0, "invalid_message", "OBJ-7", "/objects/0/scale"),
    ],
)
def test_a_frame_with_impossible_objects_is_refused(pointer, value, code, requirement, at):
    message = example("frame", "two objects")
    decode_from_server_ipc(payload(message))
    error = refusal(decode_from_server_ipc, payload(changed(message, pointer, value)))
    assert (error.code, error.requirement, error.pointer) == (code, requirement, at)
