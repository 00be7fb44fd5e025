"""What a server sends; what a client sends is in test_messages."""

import pytest
from splatbus_schemas import examples
from splatbus_wire.messages import (
    CameraReply,
    ErrorMessage,
    GetCameraPose,
    GetViewportSize,
    ViewportSize,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
)

from tests.wire.payloads import payload, payload_of, refusal


def test_a_reply_without_type_is_what_was_asked_for():
    size, pose = {"viewport_size": [64, 48]}, {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]}
    both = payload(size | pose | {"id": "not known in 1.0"})
    assert decode_from_server_message(both, GetViewportSize(3)) == ViewportSize(64, 48)
    assert isinstance(decode_from_server_message(both, GetCameraPose(0, 3)), CameraReply)


def test_a_reply_to_no_request_is_unknown():
    for reply in ({"viewport_size": [64, 48]}, {"type": "viewport_size", "viewport_size": [1, 1]}):
        error = refusal(decode_from_server_message, payload(reply), None)
        assert (error.code, error.requirement) == ("unknown_type", "CHN-11")


def test_a_reply_to_another_request_is_refused():
    reply = payload_of(encode(ViewportSize(64, 48, 3), typed_replies=True))
    error = refusal(decode_from_server_message, reply, GetCameraPose(0, 3))
    assert (error.code, error.requirement) == ("invalid_message", "REQ-7")
    for identifier in (None, 4):
        error = refusal(decode_from_server_message, reply, GetViewportSize(identifier))
        assert (error.requirement, error.pointer) == ("NEG-28", "/id")


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


@pytest.mark.parametrize(
    ("change", "code", "requirement", "pointer"),
    [
        ({"position": [0, 1e39, 0]}, "invalid_number", "POS-2", "/camera/position/1"),
        ({"rotation": [0, 0, 0, 1.011]}, "invalid_rotation", "POS-3", "/camera/rotation"),
        ({"rotation": [0, 0, 0, 0]}, "invalid_rotation", "POS-3", "/camera/rotation"),
        ({"near": 100}, "invalid_message", "IMG-1", "/camera/far"),
        ({"near": 100.5}, "invalid_message", "IMG-1", "/camera/far"),
    ],
)
def test_a_frame_with_an_impossible_camera_is_refused(change, code, requirement, pointer):
    message = examples("frame", "1.1")[0][0].message
    decode_from_server_ipc(payload(message))
    impossible = message | {"camera": message["camera"] | change}
    error = refusal(decode_from_server_ipc, payload(impossible))
    assert (error.code, error.requirement, error.pointer) == (code, requirement, pointer)


def test_a_server_may_speak_more_versions_than_a_hello_can_list():
    supported = tuple(f"{number}.0" for number in range(2, 20))
    message = ErrorMessage("unsupported_version", "no", supported=supported)
    assert decode_from_server_ipc(payload_of(encode(message))) == message


def test_what_is_supported_is_one_version_or_more():
    message = {"type": "error", "code": "unsupported_version", "message": "no", "supported": []}
    error = refusal(decode_from_server_ipc, payload(message))
    assert str(error) == "supported has 0 items, not 1 or more at /supported [NEG-10]"
