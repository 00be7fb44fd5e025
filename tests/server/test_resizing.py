"""Changes of size through sockets: no memory is kept, nobody is held up [chapter 8]."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
import splatbus_server
from splatbus_server.memory import Memory

from tests.peers.raw_client import RawClient, Reader, camera_pose, hello
from tests.server.conftest import SIZE
from tests.waiting import eventually


@pytest.fixture(autouse=True)
def memories(monkeypatch: pytest.MonkeyPatch) -> list[Memory]:
    """All that is allocated."""
    begin, allocated = Memory.__init__, []

    def recorded(self: Memory, *arguments: Any) -> None:
        begin(self, *arguments)
        allocated.append(self)

    monkeypatch.setattr(Memory, "__init__", recorded)
    return allocated


def in_use(memories: list[Memory]) -> int:
    return sum(memory._remove.alive for memory in memories)


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


def test_clients_that_die_hold_no_memory(
    bus: splatbus_server.Bus, steerer: RawClient, memories: list[Memory]
) -> None:
    """[VPT-7, IMG-17]: in whatever state they are."""
    with Reader(bus.address.ipc_port) as holding, Reader(bus.address.ipc_port) as reading:
        for reader in (holding, reading):
            reader.open()
        holding.frame()
        reading.release(reading.frame())
        assert granted(steerer, (24, 16))
        assert bus._exchange.replaced
        holding.reset()
        reading.close()
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
        # It is had, and given up again, for nobody is there who asked for it.
        assert eventually(lambda: bus._exchange.memory.generation == 3)
        assert other.viewport() == list(SIZE)
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
