"""What a server sends: what is taken for what, and what is wrong with it, where no schema says."""

import copy
from typing import Any

import pytest
from splatbus_schemas import examples
from splatbus_wire.messages import (
    CameraReply,
    ErrorMessage,
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


@pytest.mark.parametrize(
    ("reply", "other", "its_own"),
    [
        (ViewportSize(64, 48, 3), GetCameraPose(0, 3), GetViewportSize),
        (Pong(1.0, 2.0, 3), GetScene(3), lambda identifier: Ping(1.0, identifier)),
    ],
)
def test_a_reply_to_another_request_is_refused(reply, other, its_own):
    sent = payload_of(encode(reply, typed_replies=True))
    error = refusal(decode_from_server_message, sent, other)
    assert (error.code, error.requirement) == ("invalid_message", "REQ-7")
    for identifier in (None, 4):
        error = refusal(decode_from_server_message, sent, its_own(identifier))
        assert (error.requirement, error.pointer) == ("NEG-28", "/id")


@pytest.mark.parametrize(
    ("pointer", "value", "code", "requirement", "at"),
    [
        ("/camera/position", [0, 1e39, 0], "invalid_number", "POS-2", "/camera/position/1"),
        ("/camera/rotation", [0, 0, 0, 1.011], "invalid_rotation", "POS-3", "/camera/rotation"),
        ("/camera/rotation", [0, 0, 0, 0], "invalid_rotation", "POS-3", "/camera/rotation"),
        ("/camera/near", 100, "invalid_message", "IMG-1", "/camera/far"),
        ("/camera/near", 100.5, "invalid_message", "IMG-1", "/camera/far"),
        ("/objects/0/object", "default", "invalid_message", "OBJ-7", "/objects"),
        ("/objects/0/position/0", 1e39, "invalid_number", "POS-2", "/objects/0/position/0"),
        ("/objects/0/rotation/3", 1.011, "invalid_rotation", "POS-3", "/objects/0/rotation"),
    ],
)
def test_a_frame_that_cannot_be_is_refused(pointer, value, code, requirement, at):
    message = example("frame", "two objects")
    decode_from_server_ipc(payload(message))
    error = refusal(decode_from_server_ipc, payload(changed(message, pointer, value)))
    assert (error.code, error.requirement, error.pointer) == (code, requirement, at)


def test_a_reply_without_type_is_what_was_asked_for():
    size, pose = {"viewport_size": [64, 48]}, {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]}
    both = payload(size | pose | {"id": "not known in 1.0"})
    assert decode_from_server_message(both, GetViewportSize(3)) == ViewportSize(64, 48)
    assert isinstance(decode_from_server_message(both, GetCameraPose(0, 3)), CameraReply)


def test_a_reply_to_no_request_is_unknown():
    for reply in ({"viewport_size": [64, 48]}, {"type": "viewport_size", "viewport_size": [1, 1]}):
        error = refusal(decode_from_server_message, payload(reply), None)
        assert (error.code, error.requirement) == ("unknown_type", "CHN-11")


@pytest.mark.parametrize("kind", ["world", 1, None, []])
def test_an_unknown_type_from_a_server_is_unknown(kind):
    reply = payload({"type": kind, "viewport_size": [64, 48]})
    error = refusal(decode_from_server_message, reply, GetViewportSize())
    assert (error.code, error.requirement) == ("unknown_type", "NEG-9")
    error = refusal(decode_from_server_ipc, reply)
    assert (error.code, error.requirement) == ("unknown_type", "INI-11")


@pytest.mark.parametrize("code", ["teapot", "busy"])
def test_an_error_is_taken_whatever_its_code(code):
    message = payload({"type": "error", "code": code, "message": "no", "supported": ["2.0"]})
    assert decode_from_server_ipc(message) == ErrorMessage(code, "no", supported=("2.0",))


def test_a_server_may_speak_more_versions_than_a_hello_can_list():
    supported = tuple(f"{number}.0" for number in range(2, 20))
    message = ErrorMessage("unsupported_version", "no", supported=supported)
    assert decode_from_server_ipc(payload_of(encode(message))) == message


def test_what_is_supported_is_one_version_or_more():
    message = {"type": "error", "code": "unsupported_version", "message": "no", "supported": []}
    error = refusal(decode_from_server_ipc, payload(message))
    assert str(error) == "supported has 0 items, not 1 or more at /supported [NEG-10]"
