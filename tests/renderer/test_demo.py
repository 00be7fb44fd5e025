"""The demo, through sockets: every image shows the scene as its own frame says, in closed form."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import splatbus_server
from splatbus_renderer.demo import BOBBING_TIME, OBJECTS, render_until, turning_time
from splatbus_renderer.scene import (
    Camera,
    ObjectPose,
    Scene,
    default_scene,
    exact_pixel,
    multiply,
)
from splatbus_schemas import LIMITS
from splatbus_wire.rotations import rotation_matrix

from tests.peers.raw_client import RawClient, Reader, camera_pose, hello
from tests.server.stage import MESSAGE_CAPABILITIES

SIZE = (32, 24)
DEGREES = -90.0
LENS = {"fx": 90.0, "fy": 70.0, "cx": 20.0, "cy": 30.0, "width": 64, "height": 48}
TURNED = {"x": 0.0, "y": 0.6, "z": 0.0, "w": 0.8}
MOVED = {
    "type": "object_pose",
    "object": "default",
    "position": {"x": 0.3, "y": -0.2, "z": 1.5},
    "rotation": TURNED,
    "scale": 0.5,
}


@contextmanager
def serving(degrees: float) -> Iterator[tuple[splatbus_server.Bus, Reader, RawClient]]:
    """The demo, one who reads and one who steers."""
    stop = threading.Event()
    with splatbus_server.serve(
        *SIZE,
        objects=OBJECTS,
        time_range=turning_time(degrees) or BOBBING_TIME,
        ipc_port=0,
        message_port=0,
    ) as bus:
        renderer = threading.Thread(target=render_until, args=(stop, bus, 500.0, degrees))
        renderer.start()
        try:
            with Reader(bus.address.ipc_port) as reader, RawClient(bus.address.message_port) as cl:
                reader.open()
                cl.ask(hello(*MESSAGE_CAPABILITIES))
                yield bus, reader, cl
        finally:
            stop.set()
            renderer.join(10)


def matrix(rotation: Any) -> Any:
    r = rotation_matrix(tuple(rotation))
    return r[:3], r[3:6], r[6:]


def check_image(reader: Reader, frame: dict[str, Any], degrees: float) -> int:
    """Compares pixels with the closed form for the frame's own camera, objects and time.

    Returns how many show something.
    """
    told = frame["camera"]
    camera = Camera(
        *(told[name] for name in ("width", "height", "fx", "fy", "cx", "cy")),
        tuple(told["position"]),
        matrix(told["rotation"]),
        told["near"],
        told["far"],
    )
    scene = shown(frame, degrees)
    color, depth = reader.color(frame)[::-1], reader.depth(frame)[::-1]
    wrong, seen = 0, 0
    for row in range(0, told["height"], 3):
        for column in range(0, told["width"], 3):
            rgba, z = exact_pixel(scene, camera, column + 0.5, row + 0.5)
            found = depth[row, column]
            seen += math.isfinite(z)
            right = found == z or math.isclose(found, z, rel_tol=1e-4)
            wrong += not (right and np.allclose(color[row, column], rgba, atol=2e-3))
    assert wrong <= 2, "but for the rims of spheres and checks"
    return seen


def shown(frame: dict[str, Any], degrees: float) -> Scene:
    """The scene, from what the frame says and from conformance/SCENE.md."""
    half = math.radians(degrees * frame["time"]) / 2.0
    turn = matrix((0.0, math.sin(half), 0.0, math.cos(half)))
    moved = {each["object"]: each for each in frame.get("objects", [])}
    at_rest = {"position": (0, 0, 0), "rotation": (0, 0, 0, 1), "scale": 1}

    def pose(name: str) -> ObjectPose:
        placed = moved.get(name, at_rest)
        rotation = multiply(matrix(placed["rotation"]), turn)
        return ObjectPose(tuple(placed["position"]), rotation, placed["scale"])

    whole = default_scene()
    one, two, three, *others = whole.spheres
    if degrees == 0.0:
        y = 0.4 - 0.25 * (1.0 - math.cos(math.pi * frame["time"] / 2.0))
        two = replace(two, center=(-1.6, y, 3.2))
    ball = Scene((three,), None, whole.light, pose("ball"))
    return Scene((one, two, *others), whole.floor, whole.light, pose("default"), (ball,))


def settled(reader: Reader, holds: Any) -> dict[str, Any]:
    """The first frame for which it holds; it is not given back."""
    while True:
        frame = reader.frame()
        if holds(frame):
            return frame
        reader.release(frame)


@pytest.mark.parametrize("degrees", [0.0, DEGREES])
def test_every_image_shows_what_its_frame_says(degrees: float) -> None:
    """[CAM-2, CAM-5, OBJ-5 to OBJ-7, TIM-3]"""
    planes = {"near": 0.5, "far": 6.0}
    with serving(degrees) as (_, reader, client):
        for number, changes in enumerate(
            (
                [],
                [camera_pose(0.25, tag="1")],
                [camera_pose(0.25, tag="2", intrinsics=LENS | planes)],
                [MOVED, camera_pose(0.1, tag="3", rotation=TURNED | {"y": -0.6})],
                [MOVED | {"object": "ball", "scale": 2.0}, camera_pose(0.1, tag="4")],
                [{"type": "set_time", "time": 2.75}, camera_pose(0.25, tag="5")],
            )
        ):
            client.send(*changes)
            tag = str(number) if changes else None
            frame = settled(reader, lambda f: f["camera"].get("tag") == tag)  # noqa: B023
            assert check_image(reader, frame, degrees) > 10
            reader.release(frame)


def test_time_stands_still_where_it_was_set_and_plays_on_when_that_client_goes() -> None:
    """[TIM-2, IMG-10, CTL-3]"""
    with serving(DEGREES) as (bus, reader, client):
        assert bus._session.scene.time_range == (0.0, 4.0)
        client.send({"type": "set_time", "time": 9.0})
        frame = settled(reader, lambda f: f["time"] == 4.0)
        reader.release(frame)
        client.viewport()
        assert reader.silent(0.3)
        client.close()
        for _ in range(3):
            frame = reader.frame()
            reader.release(frame)
        assert frame["time"] != 4.0


def test_another_size_shows_the_scene_too() -> None:
    """[VPT-5]"""
    with serving(0.0) as (_, reader, client):
        reader.release(reader.frame())
        reply = client.ask({"type": "set_viewport", "width": 50, "height": 30, "id": 1})
        assert reply is not None
        assert reply["viewport_size"] == [50, 30]
        reader.open()
        reader.send({"type": "closed", "generation": 1})
        frame = reader.frame()
        assert (frame["camera"]["width"], frame["camera"]["height"]) == (50, 30)
        assert check_image(reader, frame, 0.0) > 10


def test_the_scene_lists_what_can_be_seen() -> None:
    """[SCN-2]"""
    *_, last = spheres = default_scene().spheres
    for listed, its in zip(
        OBJECTS, ((*spheres[:2], *spheres[3:5], last), spheres[2:3]), strict=True
    ):
        centers = [sphere.center for sphere in its]
        assert listed.gaussians == len(centers)
        assert listed.bounds == (
            tuple(np.min(centers, axis=0).tolist()),
            tuple(np.max(centers, axis=0).tolist()),
        )


def test_it_tells_how_it_does_even_while_nobody_looks() -> None:
    stop = threading.Event()
    with splatbus_server.serve(*SIZE, ipc_port=0, message_port=0) as bus:
        renderer = threading.Thread(target=render_until, args=(stop, bus))
        renderer.start()
        with RawClient(bus.address.message_port) as client:
            client.ask(hello("telemetry"))
            client.send({"type": "subscribe_telemetry", "names": None})
            message = client.receive()
        stop.set()
        renderer.join(10)
    assert message is not None
    kinds = {each["name"]: each["kind"] for each in message["series"]}
    assert kinds == {"stage": "text", "render_ms": "scalar", "render_times": "histogram"}


@pytest.mark.parametrize("extreme", [LIMITS["min_lens"], LIMITS["max_lens"]])
@pytest.mark.parametrize("distance", [LIMITS["max_position"], -LIMITS["max_position"], 1e-300])
@pytest.mark.parametrize("scale", [LIMITS["min_scale"], LIMITS["max_scale"]])
def test_no_pose_and_no_lens_stops_it(extreme: float, distance: float, scale: float) -> None:
    """Whatever is valid is rendered, if only as nothing [CAM-4, OBJ-1, POS-2]."""
    planes = {"near": LIMITS["min_lens"], "far": LIMITS["max_lens"]}
    lens = LENS | planes | {"fx": extreme, "fy": extreme, "cx": extreme}
    far_away = {"x": distance, "y": distance, "z": -distance}
    with serving(0.0) as (_, reader, client):
        client.send(
            MOVED | {"scale": scale, "position": far_away},
            camera_pose(distance, tag="extreme", intrinsics=lens),
        )
        frame = settled(reader, lambda f: f["camera"].get("tag") == "extreme")
        reader.release(frame)
        client.send(camera_pose(0.0, tag="usual", intrinsics=LENS | {"near": 0.1, "far": 9.0}))
        settled(reader, lambda f: f["camera"].get("tag") == "usual")
