"""What the author of a renderer meets, whose render loop is the test."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
import splatbus_server
from splatbus_server import Box, SceneObject, Semantics, View
from splatbus_server.memory import Memory

from tests.peers.raw_client import RawClient, Reader, hello

WIDTH, HEIGHT = 6, 5
RGB = np.linspace(0.0, 1.0, HEIGHT * WIDTH * 3, dtype=np.float32).reshape(HEIGHT, WIDTH, 3)
DEPTH = np.arange(1.0, HEIGHT * WIDTH + 1.0, dtype=np.float32).reshape(HEIGHT, WIDTH)
SCENE: dict[str, Any] = {
    "objects": [
        SceneObject("chair", "Chair", 3, Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))),
        SceneObject("default", "Room", 5),
    ],
    "time_range": (1.0, 2.0),
}
PORTS: dict[str, Any] = {"ipc_port": 0, "message_port": 0}
on_linux = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere memory is no file")


@pytest.fixture
def bus() -> Iterator[splatbus_server.Bus]:
    origin = Semantics(origin=(6e5, -6.4e5, 4.8e5))
    with splatbus_server.serve(WIDTH, HEIGHT, semantics=origin, **SCENE, **PORTS) as serving:
        yield serving


@pytest.fixture
def reader(bus: splatbus_server.Bus) -> Iterator[Reader]:
    with Reader(bus.address.ipc_port) as client:
        client.open()
        yield client


@pytest.fixture
def client(bus: splatbus_server.Bus) -> Iterator[RawClient]:
    with RawClient(bus.address.message_port) as client:
        client.ask(hello("scene", "time", "objects", "telemetry"))
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
    """[BUF-1, BUF-5, ACC-8, MEM-12]"""
    assert reader.init["semantics"]["origin"] == list(next_view(bus).origin)
    alpha = np.full((HEIGHT, WIDTH, 1), 0.5, np.float32)
    given = RGB.transpose(2, 0, 1), (0.5 / DEPTH)[None]
    color, depth = publish(bus, reader, *given, alpha=alpha, depth_kind="inverse")
    assert (color[..., :3] == RGB).all()
    assert (color[..., 3] == 1.0).all()
    np.testing.assert_allclose(depth, DEPTH, rtol=1e-6)


@pytest.mark.parametrize(("channel", "counts"), [("color", (2, 2, 0)), ("depth", (2, 0, 2))])
def test_what_nobody_reads_is_not_converted(
    bus: splatbus_server.Bus, channel: str, counts: tuple[int, int, int]
) -> None:
    """[IMG-20, IMG-21]: nor has it to be given."""
    with Reader(bus.address.ipc_port) as reader:
        reader.send({"type": "subscribe", "channels": [channel]})
        reader.open()
        assert next_view(bus).wants == {channel}
        for depth in (DEPTH, None if counts[1] else DEPTH):
            publish(bus, reader, RGB, depth)
    found = bus.statistics
    assert (found.frames_published, found.colors_converted, found.depths_converted) == counts


@pytest.mark.parametrize(
    ("images", "options", "message"),
    [
        ((RGB[:-1], DEPTH), {}, r"colour of shape \(4, 6, 3\) is neither"),
        ((RGB, DEPTH), {"stream": 1}, "takes no stream"),
    ],
)
def test_a_wrong_image_is_refused_and_the_next_is_published(
    bus: splatbus_server.Bus, reader: Reader, images: Any, options: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        bus.publish(next_view(bus), *images, **options)
    publish(bus, reader, RGB, DEPTH)


def test_what_a_renderer_without_depth_is_told_to_give_is_seen(
    bus: splatbus_server.Bus, reader: Reader
) -> None:
    """[BUF-6, BUF-7, BUF-8]: in front of what is there, and not at the 100.0 of an empty pixel."""
    view = next_view(bus)
    with pytest.raises(ValueError, match="wants_depth") as told:
        bus.publish(view, RGB)
    (advice,) = re.findall(r"np\.full\(.*\)(?=:)", str(told.value))
    _, depth = publish(bus, reader, RGB, eval(advice, {"np": np, "view": view}))
    assert ((depth > 10.0) & (depth < view.intrinsics.far) & (depth != 100.0)).all()


@pytest.mark.parametrize(
    ("color", "depth", "told"),
    [
        (np.full((3, HEIGHT, WIDTH), 2), -DEPTH, ["colour of int64 has", "no pixel has a depth"]),
        (RGB > 0.5, DEPTH, []),
        (np.full((HEIGHT, WIDTH, 4), 0.25), -DEPTH, []),
    ],
)
def test_an_image_that_shows_nothing_is_warned_of_once(
    caplog: pytest.LogCaptureFixture, color: Any, depth: Any, told: list[str]
) -> None:
    """Not for each image, nor for each size; depth that nobody gives yet is looked at later."""
    memory = Memory(WIDTH, HEIGHT, 1, Semantics())
    for each in (memory, memory.successor(WIDTH, HEIGHT)):
        for depths in (None, depth, depth):
            each.writer(color, depths, None, "linear", None)
        each.close()
    assert [it in caplog.text for it in told] == [True] * len(caplog.messages)


def test_another_size_shows_the_same_from_top_to_bottom(
    bus: splatbus_server.Bus, reader: Reader
) -> None:
    """If the renderer does not say otherwise; and an image of the former size is nobody's."""
    high, stale = next_view(bus).intrinsics, next_view(bus)
    bus.resize(24, 2 * HEIGHT)
    bus.publish(stale, RGB, DEPTH)
    reader.open()
    found = next_view(bus).intrinsics
    assert found[:4] == pytest.approx((2 * high.fx, 2 * high.fy, 12.0, HEIGHT))
    assert found[4:] == high[4:]
    own = splatbus_server.Intrinsics(1.0, 2.0, 3.0, 4.0)
    bus.resize(8, 8, own)
    assert bus._exchange.lens[:4] == own[:4]
    bus.resize(16, 16)
    assert bus._exchange.lens[:4] == (2.0, 4.0, 6.0, 8.0)


def test_the_scene_is_told_and_can_be_told_anew(
    bus: splatbus_server.Bus, client: RawClient
) -> None:
    """[SCN-2]"""
    told = client.ask({"type": "get_scene"}) or {}
    assert told["timeRange"] == [1.0, 2.0]
    assert told["objects"][0]["bounds"] == {"min": [0.0] * 3, "max": [1.0] * 3}
    room = SceneObject("default", "Room", 6)
    bus.describe([SceneObject("chair", "Chair", 4), room])
    assert (client.ask({"type": "get_scene"}) or {})["objects"][0]["gaussians"] == 4
    with pytest.raises(ValueError, match="keep their ids"):
        bus.describe([room])
    with pytest.raises(ValueError, match="gaussians"):
        bus.describe([SceneObject("chair", "Chair", -1), room])


def test_telemetry_goes_out_by_itself(bus: splatbus_server.Bus, client: RawClient) -> None:
    """[TEL-4]: by names that are identifiers, and by others."""
    client.send({"type": "subscribe_telemetry", "names": ["gpu load", "stage"]})
    client.viewport()
    bus.telemetry({"gpu load": (0.5, "%"), "unheard": lambda: 1 / 0}, stage="training")
    found = {each["name"]: each["value"] for each in (client.receive() or {})["series"]}
    assert found == {"gpu load": 0.5, "stage": "training"}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"time_range": (2.0, 1.0)}, "timeRange"),
        ({"time_range": (0.0, float("inf"))}, "JSN-4"),
        ({"objects": SCENE["objects"] * 2}, "objects"),
        ({"objects": [SceneObject("", "", 0)]}, "objects.0.id"),
        ({"objects": []}, "objects|default"),
        ({"objects": SCENE["objects"][:1]}, "default"),
        ({"semantics": Semantics(depth_empty=1e39)}, "/semantics/depth/empty"),
        ({"width": 0}, "32768"),
        ({"height": 32769}, "32768"),
        ({"memory": "vram"}, "host_shm"),
    ],
)
def test_what_nobody_could_be_told_of_is_refused(changed: dict[str, Any], message: str) -> None:
    """[INI-2, MEM-12, SCN-2]"""
    size = {"width": WIDTH, "height": HEIGHT}
    with pytest.raises(ValueError, match=message):
        splatbus_server.serve(**{**size, **SCENE, **PORTS, **changed})


def test_without_a_range_there_is_no_time() -> None:
    """[TIM-4]"""
    with (
        splatbus_server.serve(WIDTH, HEIGHT, **PORTS) as bus,
        RawClient(bus.address.message_port) as client,
    ):
        assert (client.ask(hello("time", "ping")) or {})["capabilities"] == ["ping"]


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


def place(bus: splatbus_server.Bus) -> Path:
    """Where the memory is that it announces."""
    return Path("/dev/shm", bus._exchange.memory.init_packet.memory.name)  # type: ignore[union-attr]


@on_linux
def test_no_memory_is_left_behind() -> None:
    """[OPN-9]: nor that of a size before, which somebody has."""
    with (
        splatbus_server.serve(WIDTH, HEIGHT, **PORTS) as bus,
        Reader(bus.address.ipc_port) as reader,
    ):
        reader.open()
        paths = [place(bus)]
        bus.resize(3, 2)
        paths.append(place(bus))
        assert all(path.exists() for path in paths)
    assert not any(path.exists() for path in paths)


def test_a_taken_port_is_named_and_nothing_is_left_open(bus: splatbus_server.Bus) -> None:
    taken = bus.address.message_port
    told = f"cannot listen on 127.0.0.1:{taken}: another server listens there, splatbus-server "
    with pytest.raises(OSError, match=told):
        splatbus_server.serve(WIDTH, HEIGHT, ipc_port=0, message_port=taken)


@on_linux
@pytest.mark.parametrize("is_told", [False, True])
def test_memory_whose_name_is_gone_is_made_anew_for_who_comes_next(
    bus: splatbus_server.Bus, reader: Reader, is_told: bool
) -> None:
    """Of a scene at rest, and for who has the former open too; and where it is gone by the time
    that a client which was told of it opens it.
    """
    publish(bus, reader, RGB, DEPTH)
    if not is_told:
        place(bus).unlink()
    with Reader(bus.address.ipc_port) as other:
        if is_told:
            assert (other.receive() or {})["generation"] == 1
            place(bus).unlink()
            other.send({"type": "open_failed", "generation": 1, "reason": "no such memory"})
        for each in (reader, other):
            assert each.open()["generation"] == 2
        reader.send({"type": "closed", "generation": 1})
        assert np.array_equal(publish(bus, other, RGB, DEPTH)[1], DEPTH)


@on_linux
@pytest.mark.parametrize("take", [partial(os.truncate, length=0), os.unlink])
@pytest.mark.parametrize("is_full", [False, True])
def test_memory_that_another_program_takes_away_costs_one_image(
    bus: splatbus_server.Bus,
    reader: Reader,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    is_full: bool,
    take: Callable[[Path], None],
) -> None:
    """To write there would end the process by a signal; nor does the renderer learn of it."""
    view, memory = next_view(bus), bus._exchange.memory
    take(place(bus))

    def full(width: int, height: int) -> NoReturn:
        raise OSError(errno.ENOSPC, "shared memory is full")

    if is_full:
        with monkeypatch.context() as patch:
            patch.setattr(memory, "successor", full)
            bus.publish(view, RGB, DEPTH)
        assert "shared memory is full: no image goes on" in caplog.text
    bus.publish(view, RGB, DEPTH)
    assert "another program has taken away the " in caplog.text
    assert "It was announced to raw 0. What" in caplog.text
    reader.open()
    reader.send({"type": "closed", "generation": 1})
    assert np.array_equal(publish(bus, reader, RGB, DEPTH)[1], DEPTH)
