"""Changes of size through sockets, whose memory is made in a thread of its own [chapter 8]."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
import splatbus_server
from splatbus_server.memory import Memory

from tests.peers.raw_client import RawClient, camera_pose, hello
from tests.server.conftest import SIZE
from tests.waiting import eventually

SET_VIEWPORT = {"type": "set_viewport", "width": 24, "height": 16, "id": 1}


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


@pytest.fixture
def steerer(bus: splatbus_server.Bus, gate: threading.Event) -> Iterator[RawClient]:
    """One who waits for memory."""
    with RawClient(bus.address.message_port) as client:
        client.ask(hello("viewport"))
        client.send(SET_VIEWPORT, {"type": "get_viewport_size", "id": 2})
        assert eventually(lambda: bus._session.viewport.is_changing)
        yield client


def test_nobody_else_waits_while_memory_is_made(
    bus: splatbus_server.Bus, steerer: RawClient, gate: threading.Event
) -> None:
    """[VPT-2, NEG-29, IMG-9]: neither other clients nor the renderer."""
    with RawClient(bus.address.message_port) as other:
        other.send(camera_pose(0.5))
        assert other.viewport() == list(SIZE)
        assert eventually(lambda: bus._exchange.poses.camera.position[0] == 0.5)
        assert steerer.silent(0.1)
    gate.set()
    assert [steerer.receive() for _ in range(2)] == [
        {"type": "viewport_size", "id": request, "viewport_size": [24, 16]} for request in (1, 2)
    ]


def test_the_renderer_changes_the_size_itself_meanwhile(
    bus: splatbus_server.Bus, steerer: RawClient, gate: threading.Event
) -> None:
    threading.Timer(0.1, gate.set).start()
    bus.resize(40, 9)
    assert (bus._exchange.memory.width, bus._exchange.memory.height) == (40, 9)
    reply = steerer.receive() or {}
    assert reply.get("viewport_size") == [24, 16] or reply["code"] == "busy"
    assert (steerer.receive() or {})["id"] == 2
    assert eventually(lambda: not bus._exchange.replaced)
    assert steerer.viewport() == [40, 9]


def test_a_server_that_ends_while_memory_is_made(
    gate: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    """[OPN-9]"""
    begin, memories = Memory.__init__, list[Memory]()

    def recorded(self: Memory, *arguments: Any) -> None:
        begin(self, *arguments)
        memories.append(self)

    monkeypatch.setattr(Memory, "__init__", recorded)
    bus = splatbus_server.serve(*SIZE, ipc_port=0, message_port=0)
    with RawClient(bus.address.message_port) as client:
        client.ask(hello("viewport"))
        client.send(SET_VIEWPORT)
        assert eventually(lambda: bus._session.viewport.is_changing)
        threading.Timer(0.1, gate.set).start()
        bus.close()
        assert client.receive() is None
    assert [memory._remove.alive for memory in memories] == [False, False]
    with pytest.raises(ConnectionRefusedError):
        RawClient(bus.address.message_port)
