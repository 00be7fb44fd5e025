"""Whatever one client sends, and however it ends, the others are served, and the log says why."""

from __future__ import annotations

import json
import logging
import socket
from collections.abc import Callable, Iterator

import pytest
import splatbus_server

from tests.peers.raw_client import IDENTITY, RawClient, Reader, camera_pose, hello, packet
from tests.server.conftest import SIZE
from tests.waiting import eventually

HEADERS = {
    "length 0": (bytes(4), "FRM-3"),
    "length 0xFFFFFFFF": (b"\xff" * 4, "FRM-3"),
    "an HTTP request": (b"GET / HTTP/1.1\r\n\r\n", "FRM-3"),
}


def pose_with(**members: object) -> dict[str, object]:
    return {"type": "camera_pose", **IDENTITY, **members}


def text(message: object) -> bytes:
    return json.dumps(message).encode()


IGNORED = {
    "invalid UTF-8": (b'{"type":"\xff"}', "JSN-1"),
    "an array": (text([camera_pose(9.0)]), "JSN-1"),
    "NaN": (text(camera_pose(float("nan"))), "JSN-4"),
    "2,000 brackets": (b'{"type":' + b"[" * 2_000, "JSN-5"),
    "beyond single precision": (text(camera_pose(1e39)), "POS-2"),
    "null for x": (text(pose_with(position={"x": None, "y": 0, "z": 0})), "/position/x"),
    "an unknown type": (text({"type": "shutdown"}), "REQ-8"),
}
"""Of each kind one: what else is refused, and why, is tested without sockets."""


class Neighbours:
    """Clients on both channels that have to be served all the while."""

    def __init__(self, bus: splatbus_server.Bus) -> None:
        self.mover = RawClient(bus.address.message_port)
        self.reader = Reader(bus.address.ipc_port)
        self.mover.send(camera_pose(0.0))
        self.mover.viewport()
        self.reader.open()
        self.reader.release(self.reader.frame())
        self._x = 0.0

    def are_served(self) -> bool:
        """Asks, moves the camera, and sees it move."""
        self._x += 0.125
        assert self.mover.viewport() == list(SIZE)
        self.mover.send(camera_pose(self._x))
        frame = self.reader.frame()
        seen = float(self.reader.depth(frame)[0, 0])
        self.reader.release(frame)
        return bool(seen == 1.0 + self._x == 1.0 + frame["camera"]["position"][0])

    def close(self) -> None:
        self.mover.close()
        self.reader.close()


@pytest.fixture
def neighbours(bus: splatbus_server.Bus, caplog: pytest.LogCaptureFixture) -> Iterator[Neighbours]:
    caplog.set_level(logging.INFO)
    found = Neighbours(bus)
    yield found
    found.close()


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
@pytest.mark.parametrize("name", HEADERS)
def test_a_bad_header(
    bus: splatbus_server.Bus,
    neighbours: Neighbours,
    caplog: pytest.LogCaptureFixture,
    port: str,
    name: str,
) -> None:
    """[FRM-3, CHN-14]"""
    header, reason = HEADERS[name]
    with RawClient(getattr(bus.address, port)) as rude:
        rude.socket.sendall(header)
        assert rude.receive() is None
    assert neighbours.are_served()
    assert reason in caplog.text


def test_a_header_and_then_silence(bus: splatbus_server.Bus, neighbours: Neighbours) -> None:
    """[CHN-14]; what becomes of it is in test_service [FRM-5]."""
    with RawClient(bus.address.message_port) as a, RawClient(bus.address.ipc_port) as b:
        for silent in (a, b):
            silent.socket.sendall(packet(camera_pose())[:4])
        assert neighbours.are_served()


@pytest.mark.parametrize("name", IGNORED)
def test_a_packet_that_is_ignored(
    bus: splatbus_server.Bus,
    neighbours: Neighbours,
    caplog: pytest.LogCaptureFixture,
    name: str,
) -> None:
    """[JSN-8, JSN-9, JSN-10, POS-6]: after it, the same connection is still served."""
    payload, reason = IGNORED[name]
    neighbours.mover.send(payload)
    assert neighbours.are_served()
    with RawClient(bus.address.ipc_port) as rude:
        rude.send(payload)
        reply = rude.ask(hello())
        assert reply is not None
        assert reply["type"] == "welcome"
        rude.send(payload)
        assert rude.receive()["type"] == "error"  # type: ignore[index]
    assert neighbours.are_served()
    assert "refused" in caplog.text
    assert reason in caplog.text


def test_a_request_that_cannot_be_answered(
    bus: splatbus_server.Bus, neighbours: Neighbours, caplog: pytest.LogCaptureFixture
) -> None:
    """[REQ-9]"""
    with RawClient(bus.address.message_port) as rude:
        assert rude.ask({"type": "get_camera_pose"}) is None
    assert neighbours.are_served()
    assert "REQ-2" in caplog.text
    assert eventually(lambda: "REQ-9" in caplog.text)


def test_ten_thousand_poses_at_once(bus: splatbus_server.Bus, neighbours: Neighbours) -> None:
    """[POS-7]: the last one counts, and few of the others are ever made into an image."""
    before = bus.statistics
    poses = (camera_pose(1.0 + index / 16384) for index in range(10_000))
    neighbours.mover.send(*poses)
    assert neighbours.mover.viewport() == list(SIZE)
    last = 1.0 + 9_999 / 16384
    while (frame := neighbours.reader.frame())["camera"]["position"][0] != last:
        neighbours.reader.release(frame)
    neighbours.reader.release(frame)
    after = bus.statistics
    assert after.poses_received - before.poses_received == 10_000
    views, superseded = after.views - before.views, after.poses_superseded - before.poses_superseded
    assert views + superseded == 10_000
    assert after.frames_published - before.frames_published == views
    assert neighbours.are_served()


def closes(client: RawClient) -> None:
    client.close()


def resets(client: RawClient) -> None:
    client.reset()


def dies_in_a_packet(client: RawClient) -> None:
    client.socket.sendall(packet(camera_pose(9.0))[:-1])
    client.close()


def resets_with_replies_unread(client: RawClient) -> None:
    client.send(*[{"type": "get_viewport_size"}] * 100)
    client.reset()


def closes_with_replies_unread(client: RawClient) -> None:
    client.send(*[{"type": "get_viewport_size"}] * 100)
    client.close()


def half_closes_at_once(client: RawClient) -> None:
    client.socket.shutdown(socket.SHUT_WR)
    assert client.receive() is None
    client.close()


ENDINGS = [
    closes,
    resets,
    dies_in_a_packet,
    resets_with_replies_unread,
    closes_with_replies_unread,
    half_closes_at_once,
]


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
@pytest.mark.parametrize("end", ENDINGS)
def test_a_client_that_ends(
    bus: splatbus_server.Bus,
    neighbours: Neighbours,
    caplog: pytest.LogCaptureFixture,
    port: str,
    end: Callable[[RawClient], None],
) -> None:
    """[CHN-14, FRM-6]: more of them than may be open at a time, so that each is seen to end."""
    for _ in range(20):
        client = RawClient(getattr(bus.address, port))
        end(client)
        assert neighbours.mover.viewport() == list(SIZE)
    assert neighbours.are_served()
    assert eventually(lambda: caplog.text.count("closed") >= 20)
    assert "LIM-1" not in caplog.text
    assert "defect" not in caplog.text


@pytest.mark.parametrize("end", [closes, resets])
def test_a_reader_that_dies_with_a_lease(
    bus: splatbus_server.Bus, neighbours: Neighbours, end: Callable[[RawClient], None]
) -> None:
    """[IMG-17]: more of them than there are slots, so that each slot is seen to come back."""
    for _ in range(10):
        assert eventually(lambda: reads_once(bus, end))
        assert neighbours.are_served()


def reads_once(bus: splatbus_server.Bus, end: Callable[[RawClient], None]) -> bool:
    """Takes an image and dies; False if the server is still busy with those before."""
    with Reader(bus.address.ipc_port) as reader:
        first = reader.receive()
        assert first is not None
        if first.get("code") == "too_many_clients":
            return False
        reader.send({"type": "opened", "generation": first["generation"]})
        assert reader.frame()
        end(reader)
    return True
