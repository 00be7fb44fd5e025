"""The sockets of both channels: whatever a client does, others are served, and the log says why."""

from __future__ import annotations

import logging
import re
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
import splatbus_server
from splatbus_server import connection as connection_module
from splatbus_server.peer import Peer
from splatbus_server.service import Service

from tests.peers.raw_client import RawClient, camera_pose, hello, packet
from tests.server.conftest import SIZE
from tests.waiting import eventually

REQUEST = {"type": "get_viewport_size"}
SECRET = "never to be logged"


def sends(data: bytes, client: RawClient) -> None:
    client.socket.sendall(data)


def is_answered(message: Any, client: RawClient) -> None:
    """Goes on after something that is refused."""
    client.send(message)
    assert (client.ask(hello(token=SECRET)) or {})["type"] == "welcome"
    assert (client.ask(message) or {})["type"] == "error"


def ends(how: Callable[[RawClient], None], data: bytes, client: RawClient) -> None:
    client.socket.sendall(data)
    how(client)


def half_closes(client: RawClient) -> None:
    client.socket.shutdown(socket.SHUT_WR)
    while client.receive() is not None:
        pass


POSE = packet(camera_pose(9.0))
DEEDS: list[tuple[Callable[[RawClient], None], str]] = [
    (partial(sends, bytes(4)), "FRM-3"),
    (partial(sends, b"\xff" * 4), "FRM-3"),
    (partial(sends, b"GET / HTTP/1.1\r\n\r\n"), "HTTP.*FRM-3"),
    (partial(sends, POSE[:4]), ""),
    (partial(is_answered, b'{"type":"\xff"}'), "JSN-1"),
    (partial(is_answered, camera_pose(float("nan"))), "JSN-4"),
    (partial(is_answered, b'{"type":' + b"[" * 2_000), "JSN-5"),
    (partial(is_answered, {"type": "shutdown"}), "unknown_type"),
    (partial(ends, RawClient.close, b""), "closed"),
    (partial(ends, RawClient.reset, b""), "lost|closed"),
    (partial(ends, RawClient.close, POSE[:-1]), "FRM-6"),
    (partial(ends, RawClient.reset, packet(REQUEST) * 100), "lost|closed"),
    (partial(ends, RawClient.close, packet(REQUEST) * 100), "lost|closed"),
    (partial(ends, half_closes, POSE), "closed"),
]


@pytest.mark.parametrize("port", ["ipc_port", "message_port"])
@pytest.mark.parametrize(("deed", "reason"), DEEDS)
def test_whatever_a_client_does(
    bus: splatbus_server.Bus,
    caplog: pytest.LogCaptureFixture,
    port: str,
    deed: Callable[[RawClient], None],
    reason: str,
) -> None:
    """[CHN-14]: more often than there are places, so that each is seen to end."""
    caplog.set_level(logging.INFO)
    with RawClient(bus.address.message_port) as other:
        for _ in range(11):
            with RawClient(getattr(bus.address, port)) as rude:
                deed(rude)
                assert other.viewport() == list(SIZE)
    assert eventually(lambda: re.search(reason, caplog.text) is not None)
    for never in ("defect", "LIM-1", SECRET):
        assert never not in caplog.text


def test_who_sends_as_much_as_it_can_does_not_hold_up_others(bus: splatbus_server.Bus) -> None:
    """A turn is bounded, and what was not handled in it waits its turn."""
    flood = b"".join(map(packet, [camera_pose(0.5)] * 20_000))
    with RawClient(bus.address.message_port) as busy, RawClient(bus.address.message_port) as other:
        busy.socket.setblocking(False)
        sent = busy.socket.send(flood)
        answers = 0
        while bus.statistics.poses_received < sent // len(packet(camera_pose(0.5))) - 1:
            assert other.viewport() == list(SIZE)
            answers += 1
        assert answers > 20


def test_who_does_not_read_is_not_read_from(bus: splatbus_server.Bus) -> None:
    """[LIM-2]"""
    requests = packet(REQUEST) * 200_000
    with RawClient(bus.address.message_port) as client:
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.socket.setblocking(False)
        with suppress(BlockingIOError):
            while requests:
                requests = requests[client.socket.send(requests) :]
        assert eventually(lambda: any(p.waits for p in bus._service.peers))
        (peer,) = bus._service.peers
        assert len(peer.connection.unsent) < 2 * connection_module.FULL_BYTES
        with RawClient(bus.address.message_port) as other:
            assert other.viewport() == list(SIZE)
        client.socket.setblocking(True)
        for _ in range(10_000):
            assert client.receive() == {"viewport_size": list(SIZE)}


def test_who_has_gone_is_noticed_by_the_system(bus: splatbus_server.Bus) -> None:
    """And small packets are sent at once [FRM-8]."""
    with RawClient(bus.address.message_port) as client:
        client.viewport()
        (peer,) = bus._service.peers
        assert peer.socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        assert peer.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_nobody_is_kept_busy_by_a_client_that_ended_its_stream_and_does_not_read(
    bus: splatbus_server.Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An ended stream is always readable; only when it can be written to is it looked at again."""
    bus._service._listeners["msg"].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    looked_at: list[Peer] = []
    in_vain: list[Peer] = []
    serve = Service._serve

    def counting(self: Service, peer: Peer) -> None:
        looked_at.append(peer)
        before = len(peer.connection.unsent)
        serve(self, peer)
        if len(peer.connection.unsent) == before:
            in_vain.append(peer)

    with RawClient(bus.address.message_port) as full, RawClient(bus.address.message_port) as other:
        full.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        full.send(*[{"type": "get_camera_pose", "cam_idx": 0}] * 2000)
        full.socket.shutdown(socket.SHUT_WR)
        assert eventually(lambda: any(p.connection.input_ended for p in bus._service.peers))
        (peer,) = (p for p in bus._service.peers if p.connection.input_ended)
        assert peer.connection.unsent
        monkeypatch.setattr(Service, "_serve", counting)
        for _ in range(50):
            other.viewport()
        assert in_vain.count(peer) <= 1
        assert len(looked_at) >= 50
