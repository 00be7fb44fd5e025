"""Changes of size while clients read: whole images, no freed memory, nobody held up [chapter 8]."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
import splatbus_server
from splatbus_server.memory import Memory

from tests.peers.raw_client import RawClient, Reader, camera_pose, hello, map_memory
from tests.server.conftest import SIZE
from tests.waiting import eventually

SIZES = [(16, 8), (24, 16), (40, 9), (8, 8)]


@pytest.fixture(autouse=True)
def memories(monkeypatch: pytest.MonkeyPatch) -> list[Memory]:
    """All that is allocated; what is freed is full of NaN: who has it mapped still, sees that."""
    begin, close, allocated = Memory.__init__, Memory.close, []

    def recorded(self: Memory, *arguments: Any) -> None:
        begin(self, *arguments)
        allocated.append(self)

    def poisoned(self: Memory) -> None:
        for plane in (*self._colors, *self._depths):
            plane.fill(np.nan)
        close(self)

    monkeypatch.setattr(Memory, "__init__", recorded)
    monkeypatch.setattr(Memory, "close", poisoned)
    return allocated


def in_use(memories: list[Memory]) -> int:
    return sum(memory._remove.alive for memory in memories)


class Follower(threading.Thread):
    """A client that reads every image whole, follows each change, and counts what was wrong."""

    def __init__(self, port: int, pause: float) -> None:
        super().__init__()
        self.pause = pause
        self.reader = Reader(port)
        self.reader.open()
        self.former: list[int] = []
        self.sizes: list[tuple[int, int]] = []
        self.wrong: list[Any] = []

    def run(self) -> None:
        with suppress(OSError):
            self.follow()

    def follow(self) -> None:
        while (message := self.reader.receive()) is not None:
            if "meta" in message:
                self.former.append(self.reader.init["generation"])
                self.reader.init, self.reader.memory = message, map_memory(message)
                self.answer("opened", message["generation"])
            elif message["generation"] == self.reader.init["generation"]:
                self.check(message)
            else:
                self.reader.release(message)
            while self.former:
                self.answer("closed", self.former.pop())

    def check(self, frame: dict[str, Any]) -> None:
        camera, x = frame["camera"], abs(frame["camera"]["position"][0])
        for _ in range(3):
            time.sleep(self.pause)
            color, depth = self.reader.color(frame), self.reader.depth(frame)
            size = (camera["width"], camera["height"])
            if not (color[..., :3] == np.float32(x % 1.0)).all() or not (depth == x + 1.0).all():
                self.wrong.append(frame)
            if color.shape != (*size[::-1], 4):
                self.wrong.append(size)
        self.sizes.append(size)
        self.reader.release(frame)

    def end(self) -> None:
        with suppress(OSError):
            self.reader.socket.shutdown(socket.SHUT_RDWR)

    def answer(self, kind: str, generation: int) -> None:
        self.reader.send({"type": kind, "generation": generation})


@pytest.fixture
def followers(bus: splatbus_server.Bus) -> Iterator[list[Follower]]:
    """Three clients that read all the time."""
    three = [Follower(bus.address.ipc_port, pause) for pause in (0.0, 0.002, 0.005)]
    for follower in three:
        follower.start()
    yield three
    for follower in three:
        follower.end()
        follower.join(10)
        follower.reader.close()


@pytest.fixture
def steerer(bus: splatbus_server.Bus) -> Iterator[RawClient]:
    with RawClient(bus.address.message_port) as client:
        client.ask(hello("viewport", "ping"))
        yield client


def set_viewport(size: tuple[int, int], request: int = 1) -> dict[str, Any]:
    return {"type": "set_viewport", "width": size[0], "height": size[1], "id": request}


def granted(client: RawClient, size: tuple[int, int]) -> bool:
    reply = client.ask(set_viewport(size))
    assert reply is not None
    assert reply["id"] == 1
    return reply.get("viewport_size") == list(size) or reply["code"] != "busy"


def test_three_clients_follow_every_change(
    bus: splatbus_server.Bus,
    followers: list[Follower],
    steerer: RawClient,
    memories: list[Memory],
) -> None:
    """[VPT-2, VPT-5, VPT-7, IMG-5, OPN-8]"""
    for number in range(24):
        size = SIZES[number % len(SIZES)]
        before = [len(follower.sizes) for follower in followers]
        for x in range(1, 4):
            steerer.send(camera_pose(number + x / 8))
        time.sleep(0.005)
        assert eventually(lambda: granted(steerer, size)), "memory stays in use"  # noqa: B023
        assert steerer.viewport() == list(size)
        assert eventually(
            lambda: all(
                size in follower.sizes[start:]  # noqa: B023
                for follower, start in zip(followers, before, strict=True)  # noqa: B023
            )
        )
    assert [follower.wrong for follower in followers] == [[], [], []]
    assert len(memories) == 24
    assert eventually(lambda: in_use(memories) == 1)


def test_clients_that_die_hold_no_memory(
    bus: splatbus_server.Bus,
    followers: list[Follower],
    steerer: RawClient,
    memories: list[Memory],
) -> None:
    """[VPT-7, IMG-17]: in whatever state they are."""
    with Reader(bus.address.ipc_port) as dying:
        dying.open()
        dying.frame()
        assert granted(steerer, (24, 16))
        assert dying.receive() is not None
        assert bus._exchange.replaced
        dying.reset()
        assert eventually(lambda: granted(steerer, (8, 8)))
        followers[0].end()
        assert eventually(lambda: not bus._exchange.replaced)
    assert eventually(lambda: in_use(memories) == 1)


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Memory that is not had before the event."""
    successor, gate = Memory.successor, threading.Event()

    def late(self: Memory, width: int, height: int) -> Memory:
        assert gate.wait(20)
        return successor(self, width, height)

    monkeypatch.setattr(Memory, "successor", late)
    yield gate
    gate.set()


def test_nobody_else_waits_while_memory_is_made(
    bus: splatbus_server.Bus,
    followers: list[Follower],
    steerer: RawClient,
    gate: threading.Event,
) -> None:
    """[VPT-2, NEG-29, IMG-9]: neither other clients nor the renderer."""
    steerer.send(set_viewport((24, 16)), {"type": "get_viewport_size", "id": 2})
    steerer.send({"type": "ping", "t": 0.0, "id": 3})
    with RawClient(bus.address.message_port) as other:
        assert other.viewport() == list(SIZE)
        other.send(camera_pose(0.5))
        assert other.viewport() == list(SIZE)
        assert eventually(lambda: bus._exchange.poses.camera.position[0] == 0.5)
        assert steerer.silent(0.1)
    gate.set()
    assert [steerer.receive() for _ in range(2)] == [
        {"type": "viewport_size", "id": request, "viewport_size": [24, 16]} for request in (1, 2)
    ]
    pong = steerer.receive()
    assert pong is not None
    assert pong["id"] == 3


def test_a_client_that_leaves_while_its_memory_is_made(
    bus: splatbus_server.Bus, steerer: RawClient, gate: threading.Event
) -> None:
    steerer.send(set_viewport((24, 16)))
    steerer.close()
    gate.set()
    with RawClient(bus.address.message_port) as other:
        assert eventually(lambda: other.viewport() == [24, 16])
        assert eventually(lambda: not bus._exchange.replaced)


def test_a_server_that_ends_while_memory_is_made(
    gate: threading.Event, memories: list[Memory]
) -> None:
    """[OPN-9]"""
    bus = splatbus_server.serve(*SIZE, ipc_port=0, message_port=0)
    with RawClient(bus.address.message_port) as client:
        client.ask(hello("viewport"))
        client.send(set_viewport((24, 16)))
        assert eventually(lambda: bus._session.viewport.is_changing)
        threading.Timer(0.1, gate.set).start()
        bus.close()
    assert len(memories) == 2
    assert in_use(memories) == 0


def test_the_renderer_changes_the_size_itself_meanwhile(
    bus: splatbus_server.Bus, steerer: RawClient, gate: threading.Event
) -> None:
    steerer.send(set_viewport((24, 16)))
    assert eventually(lambda: bus._session.viewport.is_changing)
    threading.Timer(0.1, gate.set).start()
    bus.resize(40, 9)
    reply = steerer.receive()
    assert reply is not None
    size = bus._exchange.memory.width, bus._exchange.memory.height
    assert size == (40, 9), "the renderer has its way"
    assert reply.get("viewport_size") == [24, 16] or reply["code"] == "busy"
    assert eventually(lambda: not bus._exchange.replaced)
    assert steerer.viewport() == [40, 9]
