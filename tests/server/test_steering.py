"""Messages that steer: what is rendered and told of them, and which are refused."""

from __future__ import annotations

from typing import Any

import pytest

from tests.peers.raw_client import IDENTITY, camera_pose
from tests.server.stage import Client, Stage

LENS = {"fx": 8.0, "fy": 8.0, "cx": 4.0, "cy": 2.0, "width": 8, "height": 4, "near": 0.1, "far": 9}


def object_pose(name: str, x: float = 0.0, **other: Any) -> dict[str, Any]:
    position = {"x": x, "y": 0.0, "z": 0.0}
    return {"type": "object_pose", "object": name, **IDENTITY, "position": position, **other}


def set_time(seconds: float) -> dict[str, Any]:
    return {"type": "set_time", "time": seconds}


def next_frame(stage: Stage, reader: Client) -> dict[str, Any]:
    stage.publish()
    frame = reader.frame()
    reader.release(frame)
    return frame


def test_a_frame_tells_the_lens_that_was_asked_for(stage: Stage) -> None:
    """[CAM-5]: for images of 4 by 2."""
    reader, steerer = stage.reader(), stage.steerer()
    steerer.say(camera_pose(1.0, intrinsics=LENS))
    view = stage.view()
    assert view is not None
    assert view.intrinsics == (4.0, 4.0, 2.0, 1.0, 0.1, 9.0)
    camera = next_frame(stage, reader)["camera"]
    assert [camera[name] for name in ("fx", "cy", "width", "far")] == [4.0, 1.0, 4, 9.0]


def test_a_tag_comes_back_once(stage: Stage) -> None:
    """[CAM-2, CAM-3]: two poses of equal values are two; who is overtaken is not told."""
    first, second, steerer = stage.reader(), stage.reader(), stage.steerer()
    assert "tag" not in next_frame(stage, first)["camera"]
    steerer.say(camera_pose(1.0, tag="overtaken"), camera_pose(2.0, tag="a"))
    assert next_frame(stage, first)["camera"]["tag"] == "a"
    steerer.say(object_pose("chair", 1.0))
    assert "tag" not in next_frame(stage, first)["camera"]
    steerer.say(camera_pose(2.0, tag="b"))
    assert stage.view() is None
    steerer.say(object_pose("chair", 2.0))
    assert next_frame(stage, first)["camera"]["tag"] == "b"
    steerer.say(camera_pose(2.0, tag="b"), object_pose("chair", 3.0))
    assert next_frame(stage, first)["camera"]["tag"] == "b"
    assert "tag" not in second.hear()[0]["camera"]


def test_each_reader_is_told_the_tag_with_its_first_image_of_the_pose(stage: Stage) -> None:
    """[CAM-2]"""
    first, steerer = stage.reader(), stage.steerer()
    steerer.say(camera_pose(1.0, tag="a"))
    next_frame(stage, first)
    steerer.say(object_pose("chair", 1.0))
    assert "tag" not in next_frame(stage, first)["camera"]
    late = stage.connect()
    late.say({"type": "opened", "generation": 1})
    assert late.hear()[-1]["camera"]["tag"] == "a"


def test_a_pose_without_a_tag_takes_it_away(stage: Stage) -> None:
    """[CAM-3]"""
    reader, steerer = stage.reader(), stage.steerer()
    steerer.say(camera_pose(1.0, tag="a"), camera_pose(2.0))
    assert "tag" not in next_frame(stage, reader)["camera"]


def test_a_frame_lists_the_objects_that_were_moved(stage: Stage) -> None:
    """[OBJ-7]"""
    reader, steerer = stage.reader(), stage.steerer()
    assert "objects" not in next_frame(stage, reader)
    steerer.say(object_pose("chair", 1.5, scale=0.5))
    (chair,) = next_frame(stage, reader)["objects"]
    expected = {"position": [1.5, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0], "scale": 0.5}
    assert chair == {"object": "chair", **expected}
    steerer.say(object_pose("chair"))
    assert "objects" not in next_frame(stage, reader)


def test_a_view_is_of_each_object(stage: Stage) -> None:
    """[OBJ-5]"""
    stage.reader()
    stage.steerer().say(object_pose("chair", 1.5, scale=0.5))
    view = stage.view()
    assert view is not None
    assert view.placement.scale == 1.0
    assert view.of("chair").object_to_world[0].tolist() == [0.5, 0.0, 0.0, 1.5]
    with pytest.raises(KeyError, match="no object 'table': the scene has default, chair"):
        view.of("table")


@pytest.mark.parametrize(("asked", "time"), [(1.25, 1.25), (-1.0, 0.0), (7.0, 2.0)])
def test_a_view_has_the_time_that_was_set(stage: Stage, asked: float, time: float) -> None:
    """[TIM-2]: at the nearest end of the scene's range."""
    stage.reader()
    stage.steerer().say(set_time(asked))
    view = stage.view()
    assert view is not None
    assert view.time == time


def test_what_a_connection_set_goes_with_it(stage: Stage) -> None:
    """[CTL-3]: and that is another image."""
    reader, steerer = stage.reader(), stage.steerer()
    own = next_frame(stage, reader)["camera"]["fx"]
    steerer.say(camera_pose(0.0, intrinsics=LENS), set_time(1.0))
    assert next_frame(stage, reader)["camera"]["fx"] == 4.0
    steerer.leave()
    view = stage.view()
    assert view is not None
    assert view.time is None
    assert next_frame(stage, reader)["camera"]["fx"] == own


REFUSED = [
    (object_pose("table"), "unknown_object", "/object"),
    (camera_pose(1.0, intrinsics=LENS | {"height": 8}), "invalid_message", "/intrinsics"),
    (camera_pose(1.0, intrinsics=LENS | {"far": 0.1}), "invalid_message", "/intrinsics/far"),
    (object_pose("chair", scale=0.0), "invalid_message", "/scale"),
    (set_time("now"), "invalid_message", "/time"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("message", "code", "pointer"), REFUSED)
def test_what_is_refused_leaves_everything_and_takes_no_control(
    stage: Stage, message: dict[str, Any], code: str, pointer: str
) -> None:
    """[OBJ-3, OBJ-4, CAM-4, CAM-6, TIM-1]"""
    before, steerer, other = stage.exchange.poses, stage.steerer(), stage.steerer()
    error = steerer.ask(message)
    assert (error["type"], error["code"], error["pointer"]) == ("error", code, pointer)
    assert stage.exchange.poses is before
    assert other.say(camera_pose(5.0)) == []
    assert steerer.ask(message)["code"] == code, "not busy: it is not valid"


@pytest.mark.parametrize(
    ("lacking", "message"),
    [
        ("objects", object_pose("chair")),
        ("time", set_time(1.0)),
        ("intrinsics", camera_pose(1.0, intrinsics=LENS)),
        ("scene", {"type": "get_scene", "id": 4}),
        ("ping", {"type": "ping", "t": 1.0, "id": 4}),
        ("viewport", {"type": "set_viewport", "width": 8, "height": 4, "id": 4}),
        ("telemetry", {"type": "subscribe_telemetry", "names": None}),
    ],
)
def test_what_was_not_agreed_is_unsupported(
    stage: Stage, lacking: str, message: dict[str, Any]
) -> None:
    """[NEG-5, NEG-29]"""
    before = stage.exchange.poses
    everything = {"intrinsics", "objects", "time", "scene", "ping", "viewport", "telemetry"}
    client = stage.steerer(*everything - {lacking})
    error = client.ask(message)
    assert error["code"] == "unsupported"
    assert error.get("id") == message.get("id")
    assert stage.exchange.poses is before
    assert stage.steerer().say(camera_pose(5.0)) == []


@pytest.mark.parametrize("message", [object_pose("chair"), set_time(1.0), camera_pose(1.0)])
def test_every_kind_of_steering_takes_control_and_is_told_busy_once(
    stage: Stage, message: dict[str, Any]
) -> None:
    """[CTL-1, CTL-2]"""
    first, second = stage.steerer(), stage.steerer()
    assert first.say(message) == []
    assert second.ask(message)["code"] == "busy"
    second.say(object_pose("chair", 9.0), set_time(2.0), camera_pose(9.0))
    assert second.hear() == []
    first.leave()
    assert stage.exchange.poses.camera.position[0] == 9.0
    assert second.say(message) == []


def test_one_who_did_not_say_hello_steers_without_tag_or_lens(stage: Stage) -> None:
    """[NEG-22]: members of 1.1 are unknown to 1.0 and ignored [JSN-7]."""
    reader, old = stage.reader(), stage.steerer()
    old.connection.welcome = None
    old.say(camera_pose(1.0, tag="t", intrinsics=LENS), object_pose("chair", 1.0), set_time(1.0))
    assert old.hear() == []
    frame = next_frame(stage, reader)
    assert frame["camera"]["position"] == [1.0, 0.0, 0.0]
    assert "tag" not in frame["camera"]
    assert "objects" not in frame


def test_the_reply_to_get_camera_pose_tells_the_lens(stage: Stage) -> None:
    """[CAM-8]: the server's own, for the present size."""
    request = {"type": "get_camera_pose", "cam_idx": 1, "id": 3}
    stage.steerer().say(camera_pose(0.0, intrinsics=LENS))
    found = stage.steerer().ask(request)["intrinsics"]
    assert (found["width"], found["height"], found["cx"]) == (4, 2, 2.0)
    stage.resize(8, 8)
    found = stage.steerer().ask(request)["intrinsics"]
    assert (found["width"], found["height"], found["cy"]) == (8, 8, 4.0)
    assert "intrinsics" not in stage.steerer("ping").ask(request)


def test_the_scene_is_told(stage: Stage) -> None:
    """[SCN-2]"""
    told = stage.steerer().ask({"type": "get_scene", "id": 9})
    chair = {"id": "chair", "name": "Chair", "gaussians": 7, "bounds": None}
    assert told["objects"][1] == chair
    assert (told["type"], told["id"], told["timeRange"], told["cameras"], told["origin"]) == (
        "scene", 9, [0.0, 2.0], 3, [0.0, 0.0, 0.0],
    )  # fmt: skip


def test_a_ping_is_answered_with_the_moment(stage: Stage) -> None:
    """[PNG-2]"""
    stage.now = 1041.375
    pong = stage.steerer().ask({"type": "ping", "t": 12.5, "id": 5})
    assert pong == {"type": "pong", "id": 5, "t": 12.5, "serverTime": 1041.375}
