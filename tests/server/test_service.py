from __future__ import annotations

import logging
import math
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import pytest
import splatbus_server
from splatbus_schemas import LIMITS
from splatbus_server import connection as connection_module
from splatbus_server import share
from splatbus_server.peer import Peer
from splatbus_server.service import Service
from splatbus_wire import packet_reader

from tests.peers.raw_client import RawClient, Reader, camera_pose, hello, packet
from tests.server.conftest import SIZE
from tests.waiting import eventually


@pytest.fixture
def short_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deadlines that a test can await; the lengths themselves are tested without sockets."""
    short = dict(LIMITS)
    for name in ("stalled_reader_seconds", "hello_seconds"):
        short[name] = 0.2
    monkeypatch.setattr(connection_module, "LIMITS", short)
    monkeypatch.setattr(packet_reader, "COMPLETION_SECONDS", 0.2)


def test_a_client_of_1_0_is_served_as_ever(bus: splatbus_server.Bus) -> None:
    """[CHN-11, REQ-3, REQ-5, REQ-7, POS-10]"""
    with RawClient(bus.address.message_port) as client:
        requests = [{"type": "get_viewport_size"}, {"type": "get_camera_pose", "cam_idx": -1}]
        client.send(camera_pose(1.0), *requests, {"type": "later_version"}, requests[0])
        assert client.receive() == {"viewport_size": list(SIZE)}
        assert client.receive() == {"position": [2.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
        assert client.receive() == {"viewport_size": list(SIZE)}


def test_the_ipc_channel_says_nothing_to_1_0(bus: splatbus_server.Bus) -> None:
    """[CHN-5, CHN-7]"""
    with RawClient(bus.address.ipc_port) as client, RawClient(bus.address.message_port) as other:
        client.send(b"not json", {"type": "get_viewport_size"}, {"type": "opened", "generation": 1})
        assert other.viewport() == list(SIZE)
        assert client.silent(0.2)


def test_a_reader_sees_what_the_camera_sees(bus: splatbus_server.Bus) -> None:
    """[POS-7, IMG-5]"""
    with RawClient(bus.address.message_port) as mover, Reader(bus.address.ipc_port) as reader:
        reader.open()
        frame = reader.frame()
        assert (reader.depth(frame) == 1.0).all()
        reader.release(frame)
        mover.send(camera_pose(0.25))
        frame = reader.frame()
        assert frame["camera"]["position"] == [0.25, 0.0, 0.0]
        assert (reader.color(frame)[..., :3] == 0.25).all()
        assert (reader.color(frame)[..., 3] == 1.0).all()
        assert (reader.depth(frame) == 1.25).all()


def test_several_clients_are_served_at_once(bus: splatbus_server.Bus) -> None:
    """[CHN-12, POS-11]"""
    with ExitStack() as stack:
        movers = [stack.enter_context(RawClient(bus.address.message_port)) for _ in range(3)]
        readers = [stack.enter_context(Reader(bus.address.ipc_port)) for _ in range(3)]
        for reader in readers:
            reader.open()
        for reader in readers:
            reader.release(reader.frame())
        for x, mover in enumerate(movers, 1):
            mover.send(camera_pose(x / 4))
            assert mover.viewport() == list(SIZE)
        for reader in readers:
            assert reader.frame()["camera"]["position"][0] == 0.25


def test_requests_are_answered_after_the_client_has_ended_its_stream(
    bus: splatbus_server.Bus,
) -> None:
    """[CHN-16]"""
    with RawClient(bus.address.message_port) as client:
        client.send(*[{"type": "get_viewport_size"}] * 500)
        client.socket.shutdown(socket.SHUT_WR)
        assert [client.receive() for _ in range(500)] == [{"viewport_size": list(SIZE)}] * 500
        assert client.receive() is None


def test_a_reply_does_not_wait_for_an_image() -> None:
    """[REQ-10, CHN-14]: here nobody renders at all."""
    with (
        splatbus_server.serve(*SIZE, ipc_port=0, message_port=0) as bus,
        RawClient(bus.address.message_port) as client,
    ):
        assert client.viewport() == list(SIZE)


@pytest.mark.usefixtures("short_limits")
def test_a_packet_that_is_never_complete_ends_its_connection(
    bus: splatbus_server.Bus, caplog: pytest.LogCaptureFixture
) -> None:
    """[FRM-5]"""
    with RawClient(bus.address.message_port) as silent, RawClient(bus.address.ipc_port) as started:
        silent.socket.sendall(packet({"type": "get_viewport_size"})[:6])
        started.socket.sendall(b"\x05")
        assert silent.receive() is None
        assert started.receive() is None
    assert eventually(lambda: caplog.text.count("FRM-5") == 2)


@pytest.mark.usefixtures("short_limits")
def test_a_client_that_never_reads_is_closed_and_costs_the_others_nothing(
    bus: splatbus_server.Bus, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """[LIM-2, CHN-14]"""
    # With rests, the system's buffers, some megabytes, would take ten seconds and more to be full.
    monkeypatch.setattr(share, "BURST_SECONDS", math.inf)
    caplog.set_level(logging.INFO)
    flood = packet({"type": "get_camera_pose", "cam_idx": 0}) * 1000
    stop = threading.Event()

    def flood_on(rude: RawClient) -> None:
        try:
            while not stop.is_set():
                rude.socket.sendall(flood)
        except OSError:
            pass

    with RawClient(bus.address.message_port) as rude, RawClient(bus.address.message_port) as fair:
        rude.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sender = threading.Thread(target=flood_on, args=(rude,))
        sender.start()
        try:
            assert eventually(lambda: "LIM-2" in caplog.text or not fair.viewport())
            assert fair.viewport() == list(SIZE)
        finally:
            stop.set()
            with suppress(OSError):
                rude.socket.shutdown(socket.SHUT_RDWR)
            sender.join(10)


@pytest.mark.usefixtures("short_limits")
def test_a_guarded_server_ends_who_says_no_hello(caplog: pytest.LogCaptureFixture) -> None:
    """[NEG-12, NEG-19]"""
    with splatbus_server.serve(*SIZE, ipc_port=0, message_port=0, token="secret") as bus:
        with RawClient(bus.address.message_port) as plain, RawClient(bus.address.ipc_port) as mute:
            plain.send({"type": "get_viewport_size"})
            assert plain.receive() is None
            assert mute.receive() is None
        with RawClient(bus.address.message_port) as client:
            reply = client.ask(hello(token="wrong"))
            assert reply is not None
            assert reply["code"] == "unauthorized"
            assert client.receive() is None
        with Reader(bus.address.ipc_port, token="secret") as reader:
            reader.open()
    assert "NEG-12" in caplog.text
    assert "secret" not in caplog.text


def test_the_clock_of_pings_is_that_of_images(bus: splatbus_server.Bus) -> None:
    """[PNG-2, PNG-3]: a client knows it to within half the round trip."""
    with RawClient(bus.address.message_port) as client, Reader(bus.address.ipc_port) as reader:
        client.ask(hello("ping"))
        before = time.monotonic()
        reader.open()
        rendered_at = reader.frame()["renderedAt"]
        for number in range(20):
            sent = time.monotonic()
            pong = client.ask({"type": "ping", "t": sent, "id": number})
            received = time.monotonic()
            assert pong is not None
            assert (pong["t"], pong["id"]) == (sent, number)
            assert abs(pong["serverTime"] - (sent + received) / 2) <= (received - sent) / 2
            assert before <= rendered_at <= pong["serverTime"]


def test_telemetry_goes_out_by_itself_and_not_ahead_of_a_subscription(
    bus: splatbus_server.Bus,
) -> None:
    """[TEL-3, TEL-4]"""
    computed: list[float] = []

    def load() -> tuple[float, str]:
        computed.append(0.5)
        return 0.5, "%"

    bus.telemetry({"gpu load": load}, stage="training")
    with RawClient(bus.address.message_port) as client:
        client.ask(hello("telemetry"))
        client.send({"type": "subscribe_telemetry", "names": ["gpu load"]})
        client.viewport()
        assert not computed
        bus.telemetry({"gpu load": load}, stage="training")
        message = client.receive()
    assert message is not None
    load_now = {"name": "gpu load", "kind": "scalar", "value": 0.5, "unit": "%"}
    assert message["series"] == [load_now]
    assert computed == [0.5]
    assert (bus.statistics.series_computed, bus.statistics.telemetry_sent) == (1, 1)


def test_a_flood_of_telemetry_does_not_hold_up_replies(bus: splatbus_server.Bus) -> None:
    """[TEL-5]: nor does it end who does not read it."""
    text = "x" * 4096
    with RawClient(bus.address.message_port) as idle, RawClient(bus.address.message_port) as other:
        for client in (idle, other):
            client.ask(hello("telemetry"))
        idle.send({"type": "subscribe_telemetry", "names": None})
        idle.viewport()
        for _ in range(4000):
            bus.telemetry(a=text)
        assert other.viewport() == list(SIZE)
        idle.send({"type": "get_viewport_size", "id": 9})
        while (message := idle.receive()) is not None and message["type"] == "telemetry":
            pass
        assert message is not None
        assert message["id"] == 9


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
    requests = b"".join(map(packet, [{"type": "get_viewport_size"}] * 200_000))
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
    with RawClient(bus.address.message_port) as client:
        client.viewport()
        (peer,) = bus._service.peers
        assert peer.socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)


def test_small_packets_are_sent_at_once(bus: splatbus_server.Bus) -> None:
    """[FRM-8]"""
    with RawClient(bus.address.message_port) as client:
        client.viewport()
        (peer,) = bus._service.peers
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


def test_everything_is_closed_at_the_end(bus_closed: tuple[RawClient, splatbus_server.Bus]) -> None:
    client, bus = bus_closed
    assert client.receive() is None
    with pytest.raises(ConnectionRefusedError):
        RawClient(bus.address.message_port)


@pytest.fixture
def bus_closed() -> Iterator[tuple[RawClient, splatbus_server.Bus]]:
    bus = splatbus_server.serve(*SIZE, ipc_port=0, message_port=0)
    with RawClient(bus.address.message_port) as client:
        client.viewport()
        bus.close()
        yield client, bus
