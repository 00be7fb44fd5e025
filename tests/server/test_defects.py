"""A defect of the service, or of what it stands on, ends connections and nothing else."""

from __future__ import annotations

import errno
import socket

import pytest
import splatbus_server
from splatbus_server import service as service_module
from splatbus_server.peer import Peer
from splatbus_server.service import Service
from splatbus_server.session import Session
from splatbus_wire.messages import GetCameraPose

from tests.peers.raw_client import RawClient, Reader, camera_pose, hello
from tests.server.conftest import SIZE
from tests.waiting import eventually


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> None:
    """A server with a defect that shows with every `get_camera_pose`."""
    handle = Session.handle

    def fail(self: Session, connection: object, message: object, now: float) -> object:
        if isinstance(message, GetCameraPose):
            raise ZeroDivisionError
        return handle(self, connection, message, now)  # type: ignore[arg-type]

    monkeypatch.setattr(Session, "handle", fail)


ASK_FOR_TROUBLE = {"type": "get_camera_pose", "cam_idx": 0, "id": 7}


def test_a_defect_costs_one_request_only(
    bus: splatbus_server.Bus, faulty: None, caplog: pytest.LogCaptureFixture
) -> None:
    """[NEG-26, NEG-29]"""
    with RawClient(bus.address.message_port) as client:
        client.ask(hello())
        error = client.ask(ASK_FOR_TROUBLE)
        assert error is not None
        assert (error["type"], error["code"], error["id"]) == ("error", "internal", 7)
        assert client.viewport() == list(SIZE)
        client.ask(ASK_FOR_TROUBLE)
    assert "ZeroDivisionError" in caplog.text
    assert bus.statistics.refused["internal"] == 2


def test_a_defect_costs_one_connection_of_1_0_only(bus: splatbus_server.Bus, faulty: None) -> None:
    """[CHN-14, NEG-22]: there a reply that does not come would be taken for late for ever."""
    with RawClient(bus.address.message_port) as first, RawClient(bus.address.message_port) as other:
        assert first.ask(ASK_FOR_TROUBLE) is None
        assert other.viewport() == list(SIZE)


def test_a_defect_in_reading_costs_one_connection_only(
    bus: splatbus_server.Bus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """[CHN-14]"""
    take = Service.take

    def fail(self: Service, peer: Peer, data: bytes) -> None:
        if b"trouble" in data:
            raise ZeroDivisionError
        take(self, peer, data)

    monkeypatch.setattr(Service, "take", fail)
    with RawClient(bus.address.message_port) as first, RawClient(bus.address.message_port) as other:
        assert first.ask({"type": "trouble"}) is None
        assert other.viewport() == list(SIZE)
    assert "ZeroDivisionError" in caplog.text


def out_of_files(self: object) -> object:
    raise OSError(errno.EMFILE, "Too many open files")


def test_without_files_nobody_is_accepted_and_all_others_are_served(
    bus: splatbus_server.Bus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Both listeners are ready in one turn; and the thread must not spin, though they stay so."""
    turns = []
    turn = Service._turn
    monkeypatch.setattr(service_module, "PAUSE_SECONDS", 0.2)
    monkeypatch.setattr(Service, "_turn", lambda self: (turns.append(1), turn(self)))
    with RawClient(bus.address.message_port) as client:
        assert client.viewport() == list(SIZE)
        with monkeypatch.context() as patch:
            patch.setattr(socket.socket, "accept", out_of_files)
            with RawClient(bus.address.message_port) as late, RawClient(bus.address.ipc_port):
                assert eventually(lambda: caplog.text.count("Too many open files") >= 4)
                assert len(turns) < 100
                assert client.viewport() == list(SIZE)
                patch.undo()
                assert late.viewport() == list(SIZE)


def test_a_defect_of_the_service_ends_connections_and_neither_thread(
    bus: splatbus_server.Bus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The renderer learns nothing of it, and whoever connects again is served."""

    def breaks(self: Session, now: float) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(service_module, "PAUSE_SECONDS", 0.05)
    with RawClient(bus.address.message_port) as client:
        assert client.viewport() == list(SIZE)
        with monkeypatch.context() as patch:
            patch.setattr(Session, "catch_up", breaks)
            client.send(camera_pose(1.0))
            assert client.receive() is None
    assert eventually(lambda: "a defect of this server" in caplog.text)
    with RawClient(bus.address.message_port) as mover, Reader(bus.address.ipc_port) as reader:
        mover.send(camera_pose(0.5))
        reader.open()
        while (frame := reader.frame())["camera"]["position"][0] != 0.5:
            reader.release(frame)
