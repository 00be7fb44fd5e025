"""What a broken message was meant to be."""

import pytest
from splatbus_conformance.wire.message_kinds import (
    CLIENT_1_0,
    CLIENT_1_1,
    NUMBER,
    kind_of,
    shape_of,
)


@pytest.mark.parametrize("kind", [*CLIENT_1_0, *CLIENT_1_1])
def test_a_client_s_message_is_what_its_type_says(kind: str) -> None:
    assert kind_of("msg", "c2s", {"type": kind}) == kind


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ({"type": "CameraPose"}, "camera_pose"),
        ({"type": "get-viewport-size"}, "get_viewport_size"),
        ({"type": "pose", "position": 0, "rotation": 0}, "camera_pose"),
        ({"position": 0, "rotation": 0}, "camera_pose"),
        ({"cam_idx": 0}, "get_camera_pose"),
        ({"type": "getScene"}, "get_scene"),
        ({"object": "a", "position": 0, "rotation": 0}, "object_pose"),
        ({"type": "Hello"}, None),
        ({"type": "welcome"}, None),
        ({"type": ["camera_pose"]}, None),
        ({}, None),
    ],
)
def test_a_client_s_message_that_misses_its_type(message: dict, kind: str | None) -> None:
    assert kind_of("msg", "c2s", message) == kind


@pytest.mark.parametrize(
    ("channel", "message", "kind"),
    [
        ("ipc", {"meta": {}}, "init_packet"),
        ("ipc", {"mem_color": ""}, "init_packet"),
        ("ipc", {"type": "later", "meta": {}}, "init_packet"),
        ("ipc", {"type": "later", "ring": {}}, None),
        ("ipc", {}, None),
        ("ipc", {"viewport_size": [1, 1]}, None),
        ("msg", {"viewport_size": [1, 1]}, "viewport_size"),
        ("msg", {"type": "size", "viewport_size": [1, 1]}, "viewport_size"),
        ("msg", {"rotation": []}, "camera"),
        ("msg", {"type": "camera"}, "camera"),
        ("msg", {"meta": {}}, None),
        ("msg", {"type": "hello"}, None),
        ("msg", {"type": "error"}, "error"),
        ("ipc", {"type": "frame", "meta": {}}, "frame"),
        ("msg", {"type": "scene"}, "scene"),
        ("msg", {"timeRange": None}, "scene"),
        ("msg", {"type": "Pong", "serverTime": 1}, "pong"),
        ("msg", {"type": "scene", "timeRange": None, "position": 0}, "scene"),
        ("msg", {"type": "camera", "viewport_size": [1, 1]}, "viewport_size"),
        ("msg", {"type": "telemetry", "series": []}, "telemetry"),
        ("ipc", {"type": "scene", "timeRange": None}, None),
    ],
)
def test_a_server_s_message(channel: str, message: dict, kind: str | None) -> None:
    assert kind_of(channel, "s2c", message) == kind


def test_an_id_is_a_number_only_after_welcome() -> None:
    assert "id" not in shape_of("get_viewport_size", negotiated=False)
    assert shape_of("get_viewport_size", negotiated=True)["id"] == NUMBER
    assert "id" not in shape_of("camera_pose", negotiated=True)
    assert "intrinsics" not in shape_of("camera_pose", negotiated=False)
    assert shape_of("camera_pose", negotiated=True)["intrinsics"]["fx"] == NUMBER
    assert shape_of(None, negotiated=True) == {}
