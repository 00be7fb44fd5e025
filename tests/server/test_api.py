from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
import splatbus_server
from splatbus_server import View

from tests.peers.raw_client import IDENTITY, RawClient, Reader, camera_pose, hello
from tests.waiting import eventually

WIDTH, HEIGHT = 6, 5
RGB = np.linspace(0.0, 1.0, HEIGHT * WIDTH * 3, dtype=np.float32).reshape(HEIGHT, WIDTH, 3)
DEPTH = np.arange(1.0, HEIGHT * WIDTH + 1.0, dtype=np.float32).reshape(HEIGHT, WIDTH)


@pytest.fixture
def bus() -> Iterator[splatbus_server.Bus]:
    """A server whose render loop is the test."""
    with splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0) as serving:
        yield serving


@pytest.fixture
def reader(bus: splatbus_server.Bus) -> Iterator[Reader]:
    with Reader(bus.address.ipc_port) as client:
        client.open()
        yield client


def next_view(bus: splatbus_server.Bus, **arguments: Any) -> View:
    view = bus.next_view(10.0, **arguments)
    assert view is not None
    return view


def publish(
    bus: splatbus_server.Bus, reader: Reader, *images: Any, **arguments: Any
) -> tuple[Any, Any]:
    """Publishes; returns colour and depth as the reader sees them, top row first."""
    bus.publish(next_view(bus, contents_changed=True), *images, **arguments)
    frame = reader.frame()
    color, depth = reader.color(frame)[::-1].copy(), reader.depth(frame)[::-1].copy()
    reader.release(frame)
    return color, depth


def test_what_is_published_is_what_is_read(bus: splatbus_server.Bus, reader: Reader) -> None:
    """[BUF-1, BUF-5]"""
    color, depth = publish(bus, reader, RGB.transpose(2, 0, 1), DEPTH)
    assert (color[..., :3] == RGB).all()
    assert (color[..., 3] == 1.0).all()
    assert (depth == DEPTH).all()


def test_the_alpha_of_the_colour_tells_what_is_empty(
    bus: splatbus_server.Bus, reader: Reader
) -> None:
    """[ACC-9, BUF-7]; an alpha that is given wins."""
    rgba = np.ones((HEIGHT, WIDTH, 4), np.float32)
    rgba[0, :, 3] = 0.0
    for color in (rgba, rgba.transpose(2, 0, 1)):
        _, depth = publish(bus, reader, color, DEPTH)
        assert np.isinf(depth[0]).all()
        assert (depth[1:] == DEPTH[1:]).all()
    _, depth = publish(bus, reader, rgba, DEPTH, alpha=np.ones_like(DEPTH))
    assert (depth == DEPTH).all()


def test_inverse_depth_is_divided_by_alpha(bus: splatbus_server.Bus, reader: Reader) -> None:
    """[ACC-8]"""
    alpha = np.full((HEIGHT, WIDTH, 1), 0.5, np.float32)
    inverse = (alpha[..., 0] / DEPTH)[None]
    _, depth = publish(bus, reader, RGB, inverse, alpha=alpha, depth_kind="inverse")
    np.testing.assert_allclose(depth, DEPTH, rtol=1e-6)


@pytest.fixture
def reader_of(bus: splatbus_server.Bus) -> Iterator[Callable[[str], Reader]]:
    """Makes a client that wants one channel from the beginning [IMG-20]."""
    with Reader(bus.address.ipc_port) as client:

        def wants_only(channel: str) -> Reader:
            client.send({"type": "subscribe", "channels": [channel]})
            client.open()
            return client

        yield wants_only


def test_depth_that_nobody_reads_is_not_converted(
    bus: splatbus_server.Bus, reader_of: Callable[[str], Reader]
) -> None:
    """[IMG-21]"""
    reader = reader_of("color")
    assert eventually(lambda: not next_view(bus).wants_depth)
    bus.publish(next_view(bus), RGB, DEPTH)
    reader.release(reader.frame())
    bus.publish(next_view(bus, contents_changed=True), RGB)
    reader.release(reader.frame())
    counts = bus.statistics
    assert (counts.frames_published, counts.colors_converted, counts.depths_converted) == (2, 2, 0)


def test_colour_that_nobody_reads_is_not_converted(
    bus: splatbus_server.Bus, reader_of: Callable[[str], Reader]
) -> None:
    """[IMG-21]"""
    reader = reader_of("depth")
    assert eventually(lambda: next_view(bus).wants == {"depth"})
    bus.publish(next_view(bus), RGB, DEPTH)
    frame = reader.frame()
    assert (reader.depth(frame)[::-1] == DEPTH).all()
    assert bus.statistics.colors_converted == 0


def test_an_unchanged_scene_is_rendered_once(bus: splatbus_server.Bus, reader: Reader) -> None:
    """[IMG-10]"""
    publish(bus, reader, RGB, DEPTH)
    with RawClient(bus.address.message_port) as mover:
        mover.send(*[camera_pose(0.0)] * 50)
        mover.viewport()
        assert bus.next_view(0.05) is None
        mover.send(camera_pose(1.0))
        assert next_view(bus).poses.camera.position[0] == 1.0
    assert bus.statistics.frames_published == 1


def test_the_camera_of_a_frame_is_the_one_it_was_rendered_with(
    bus: splatbus_server.Bus, reader: Reader
) -> None:
    """[IMG-5]: not the newest that has arrived since."""
    view = next_view(bus)
    with RawClient(bus.address.message_port) as mover:
        mover.send(camera_pose(1.0))
        assert eventually(lambda: next_view(bus).poses.camera.position[0] == 1.0)
    bus.publish(view, RGB, DEPTH, time=2.5)
    frame = reader.frame()
    assert frame["camera"]["position"] == [0.0, 0.0, 0.0]
    assert frame["time"] == 2.5
    assert next_view(bus).poses.camera.position[0] == 1.0


@pytest.mark.parametrize(
    ("color", "depth", "message"),
    [
        (RGB[:-1], DEPTH, r"colour of shape \(4, 6, 3\) is neither"),
        (RGB[..., :2], DEPTH, "colour of shape"),
        (DEPTH, DEPTH, "colour of shape"),
        (RGB, DEPTH.T, r"depth of shape \(6, 5\) is not \(5, 6\)"),
        (RGB, None, "wants_depth"),
    ],
)
def test_a_wrong_image_is_refused_and_the_next_is_published(
    bus: splatbus_server.Bus, reader: Reader, color: Any, depth: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        bus.publish(next_view(bus), color, depth)
    publish(bus, reader, RGB, DEPTH)


def test_another_size_reaches_the_reader(bus: splatbus_server.Bus, reader: Reader) -> None:
    """[MEM-1, REQ-4]"""
    publish(bus, reader, RGB, DEPTH)
    stale = next_view(bus, contents_changed=True)
    bus.resize(3, 2)
    bus.publish(stale, RGB, DEPTH)
    former = reader.init["generation"]
    assert reader.open()["meta"]["w"] == 3
    reader.send({"type": "closed", "generation": former})
    view = next_view(bus)
    assert (view.width, view.height) == (3, 2)
    bus.publish(view, np.ones((2, 3, 3)), np.ones((2, 3)))
    assert reader.color(reader.frame()).shape == (2, 3, 4)
    with RawClient(bus.address.message_port) as client:
        assert client.viewport() == [3, 2]


def test_another_size_shows_the_same_from_top_to_bottom(
    bus: splatbus_server.Bus, reader: Reader
) -> None:
    """Whoever changes it; and the renderer can say otherwise."""
    high = next_view(bus).intrinsics
    bus.resize(24, 2 * HEIGHT)
    reader.open()
    fx, fy, cx, cy, near, far = next_view(bus).intrinsics
    assert (fx, fy, cx, cy) == pytest.approx((2 * high.fx, 2 * high.fy, 12.0, HEIGHT))
    assert (near, far) == high[4:]
    own = splatbus_server.Intrinsics(1.0, 2.0, 3.0, 4.0)
    bus.resize(8, 8, own)
    assert bus._exchange.lens[:4] == own[:4]
    bus.resize(16, 16)
    assert bus._exchange.lens[:4] == (2.0, 4.0, 6.0, 8.0)


SCENE: dict[str, Any] = {
    "objects": [
        splatbus_server.SceneObject(
            "chair", "Chair", 3, splatbus_server.Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
        ),
        splatbus_server.SceneObject("default", "Room", 5),
    ],
    "time_range": (1.0, 2.0),
}


def test_the_scene_is_told_and_can_be_told_anew() -> None:
    """[SCN-2, TIM-4]"""
    with (
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0, **SCENE) as bus,
        RawClient(bus.address.message_port) as client,
    ):
        client.send(hello("scene", "time", "objects"))
        assert (client.receive() or {})["capabilities"] == ["scene", "time", "objects"]
        told = client.ask({"type": "get_scene"})
        assert told is not None
        assert told["timeRange"] == [1.0, 2.0]
        assert told["objects"][0]["bounds"] == {"min": [0.0] * 3, "max": [1.0] * 3}
        room = splatbus_server.SceneObject("default", "Room", 6)
        bus.describe([splatbus_server.SceneObject("chair", "Chair", 4), room])
        assert (client.ask({"type": "get_scene"}) or {})["objects"][0]["gaussians"] == 4
        with pytest.raises(ValueError, match="keep their ids"):
            bus.describe([room])
        with pytest.raises(ValueError, match="gaussians"):
            bus.describe([splatbus_server.SceneObject("chair", "Chair", -1), room])
        table = {"type": "object_pose", "object": "table", **IDENTITY}
        assert (client.ask(table) or {})["code"] == "unknown_object"
        client.send(table | {"object": "default"}, table | {"object": "chair"})
        assert client.viewport() == [WIDTH, HEIGHT]


def test_time_that_is_not_given_is_the_views() -> None:
    """[TIM-3]"""
    with (
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0, **SCENE) as bus,
        RawClient(bus.address.message_port) as client,
        Reader(bus.address.ipc_port) as reader,
    ):
        reader.open()
        bus.publish(next_view(bus), RGB, DEPTH)
        frame = reader.frame()
        assert frame["time"] == 0.0
        reader.release(frame)
        client.ask(hello("time"))
        client.send({"type": "set_time", "time": 1.25})
        view = next_view(bus)
        assert view.time == 1.25
        bus.publish(view, RGB, DEPTH)
        assert reader.frame()["time"] == 1.25


def test_without_a_range_there_is_no_time(bus: splatbus_server.Bus) -> None:
    """[TIM-4]"""
    with RawClient(bus.address.message_port) as client:
        assert (client.ask(hello("time", "ping")) or {})["capabilities"] == ["ping"]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"time_range": (2.0, 1.0)}, "timeRange"),
        ({"time_range": (0.0, float("inf"))}, "JSN-4"),
        ({"objects": SCENE["objects"] * 2}, "objects"),
        ({"objects": [splatbus_server.SceneObject("", "", 0)]}, "objects.0.id"),
        ({"objects": []}, "objects|default"),
        ({"objects": SCENE["objects"][:1]}, "default"),
    ],
)
def test_a_scene_that_nobody_could_be_told_of_is_refused(
    changed: dict[str, Any], message: str
) -> None:
    """[SCN-2]"""
    with pytest.raises(ValueError, match=message):
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0, **{**SCENE, **changed})


def test_an_empty_depth_that_no_pixel_holds_is_refused() -> None:
    """[MEM-12]"""
    beyond = splatbus_server.Semantics(depth_empty=1e39)
    with pytest.raises(ValueError, match="/semantics/depth/empty"):
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0, semantics=beyond)


@pytest.mark.parametrize("size", [(0, 1), (1, 32769)])
def test_a_size_has_its_range(bus: splatbus_server.Bus, size: tuple[int, int]) -> None:
    """[INI-2]"""
    with pytest.raises(ValueError, match="32768"):
        bus.resize(*size)
    with pytest.raises(ValueError, match="32768"):
        splatbus_server.serve(*size, ipc_port=0, message_port=0)


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it cannot be listed")


@on_linux
@pytest.mark.parametrize("end", ["", "os.fork() or exit()\nos.wait()\nassert os.path.exists(path)"])
def test_a_program_that_ends_without_closing_leaves_no_memory(end: str) -> None:
    """[OPN-9]; nor does a child that it forked take the memory away."""
    program = f"""
import os, splatbus_server
bus = splatbus_server.serve(4, 4, ipc_port=0, message_port=0)
path = "/dev/shm/" + bus._exchange.memory.init_packet.memory.name
assert os.path.exists(path)
print(path)
{end}
"""
    command = [sys.executable, "-W", "ignore", "-c", program]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert not Path(result.stdout.splitlines()[0]).exists()


@on_linux
def test_no_memory_is_left_behind() -> None:
    """[OPN-9]"""
    names = []
    with (
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=0) as bus,
        Reader(bus.address.ipc_port) as reader,
    ):
        names.append(reader.open()["memory"]["name"])
        bus.resize(3, 2)
        names.append(reader.open()["memory"]["name"])
        assert all((Path("/dev/shm") / name).exists() for name in names)
    assert not any((Path("/dev/shm") / name).exists() for name in names)


def test_a_taken_port_is_named_and_nothing_is_left_open(bus: splatbus_server.Bus) -> None:
    taken = bus.address.message_port
    with pytest.raises(OSError, match=f"cannot listen on 127.0.0.1:{taken}"):
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=taken)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_kind_of_memory_that_is_not_known_is_refused() -> None:
    with pytest.raises(ValueError, match="host_shm"):
        splatbus_server.serve(4, 2, memory="vram", ipc_port=0, message_port=0)  # type: ignore[arg-type]


def test_a_stream_is_nothing_to_memory_of_the_host(bus: splatbus_server.Bus) -> None:
    with Reader(bus.address.ipc_port) as reader:
        reader.open()
        view = bus.next_view(10.0)
        assert view is not None
        image = np.zeros((view.height, view.width, 3), np.float32)
        with pytest.raises(ValueError, match="takes no stream"):
            bus.publish(view, image, image[..., 0], stream=1)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory cannot be cut short")
def test_memory_that_another_program_cuts_short_costs_one_image(
    bus: splatbus_server.Bus, reader: Reader, caplog: pytest.LogCaptureFixture
) -> None:
    """To write there would end the process by a signal."""
    view = next_view(bus)
    name = bus._exchange.memory.init_packet.memory.name  # type: ignore[union-attr]
    os.truncate(f"/dev/shm/{name}", 0)
    bus.publish(view, RGB, DEPTH)
    assert "cut the memory of generation 1 short" in caplog.text
    reader.open()
    reader.send({"type": "closed", "generation": 1})
    assert np.array_equal(publish(bus, reader, RGB, DEPTH)[1], DEPTH)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory cannot be cut short")
def test_a_renderer_is_not_told_that_there_is_no_memory_to_go_on_in(
    bus: splatbus_server.Bus,
    reader: Reader,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    view = next_view(bus)
    memory = bus._exchange.memory
    os.truncate(f"/dev/shm/{memory.init_packet.memory.name}", 0)  # type: ignore[union-attr]

    def full(width: int, height: int) -> NoReturn:
        raise OSError(errno.ENOSPC, "shared memory is full")

    with monkeypatch.context() as patch:
        patch.setattr(memory, "successor", full)
        bus.publish(view, RGB, DEPTH)
        assert "shared memory is full: no image goes on" in caplog.text
    bus.publish(view, RGB, DEPTH)
    reader.open()
    reader.send({"type": "closed", "generation": 1})
    assert np.array_equal(publish(bus, reader, RGB, DEPTH)[1], DEPTH)
