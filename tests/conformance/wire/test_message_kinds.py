"""What a broken message was meant to be."""

import pytest
from splatbus_conformance.wire.message_kinds import NUMBER, kind_of, shape_of


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ({"type": "set_time"}, "set_time"),
        ({"type": "get-ViewportSize", "position": 0, "rotation": 0}, "get_viewport_size"),
        ({"type": "pose", "position": 0, "rotation": 0}, "camera_pose"),
        ({"object": "a", "position": 0, "rotation": 0}, "object_pose"),
        ({"cam_idx": 0}, "get_camera_pose"),
        ({"type": "Hello", "position": 0}, None),
        ({"type": ["camera_pose"]}, None),
    ],
)
def test_a_client_s_message_that_misses_its_type(message: dict, kind: str | None) -> None:
    assert kind_of("msg", "c2s", message) == kind


@pytest.mark.parametrize(
    ("channel", "message", "kind"),
    [
        ("ipc", {"mem_color": ""}, "init_packet"),
        ("ipc", {"type": "later", "meta": {}}, "init_packet"),
        ("ipc", {"type": "later", "ring": {}}, None),
        ("ipc", {"viewport_size": [1, 1]}, None),
        ("ipc", {"type": "frame", "meta": {}}, "frame"),
        ("ipc", {"type": "scene", "timeRange": None}, None),
        ("msg", {"meta": {}}, None),
        ("msg", {"type": "hello"}, None),
        ("msg", {"type": "size", "viewport_size": [1, 1]}, "viewport_size"),
        ("msg", {"rotation": []}, "camera"),
        ("msg", {"type": "camera"}, "camera"),
        ("msg", {"type": "Pong", "serverTime": 1}, "pong"),
        ("msg", {"type": "scene", "timeRange": None, "position": 0}, "scene"),
        ("msg", {"type": "camera", "viewport_size": [1, 1]}, "viewport_size"),
        ("msg", {"type": "telemetry", "series": []}, "telemetry"),
    ],
)
def test_a_server_s_message(channel: str, message: dict, kind: str | None) -> None:
    assert kind_of(channel, "s2c", message) == kind


def test_an_id_and_intrinsics_mean_something_only_after_welcome() -> None:
    before, after = (
        {"id", "intrinsics"} & {*shape_of("get_camera_pose", negotiated=it)}
        | {"intrinsics"} & {*shape_of("camera_pose", negotiated=it)}
        for it in (False, True)
    )
    assert (before, after) == (set(), {"id", "intrinsics"})
    assert shape_of("camera_pose", negotiated=True)["intrinsics"]["fx"] == NUMBER
    assert shape_of(None, negotiated=True) == {}
