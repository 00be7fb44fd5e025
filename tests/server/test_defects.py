"""A defect of the service, or of what it stands on, ends connections and nothing else."""

from __future__ import annotations

import errno
import socket
from typing import Any

import pytest
import splatbus_server
from splatbus_server import service as service_module
from splatbus_server.service import Service
from splatbus_server.session import Session
from splatbus_wire.messages import GetCameraPose

from tests.peers.raw_client import RawClient, camera_pose, hello
from tests.server.conftest import SIZE
from tests.waiting import eventually

TROUBLE = {"type": "get_camera_pose", "cam_idx": 0, "id": 7}


@pytest.mark.parametrize("says_hello", [True, False])
def test_a_defect_costs_one_request_only(
    bus: splatbus_server.Bus,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    says_hello: bool,
) -> None:
    """[NEG-26, NEG-29]: of 1.0 one connection, for a reply would be awaited for ever [CHN-14]."""
    handle = Session.handle

    def fail(self: Session, connection: Any, message: Any, now: float) -> Any:
        if isinstance(message, GetCameraPose):
            raise ZeroDivisionError
        return handle(self, connection, message, now)

    monkeypatch.setattr(Session, "handle", fail)
    with (
        RawClient(bus.address.message_port) as client,
        RawClient(bus.address.message_port) as other,
    ):
        if says_hello:
            client.ask(hello())
            for _ in range(2):
                error = client.ask(TROUBLE) or {}
                assert (error["type"], error["code"], error["id"]) == ("error", "internal", 7)
            assert client.viewport() == list(SIZE)
        else:
            assert client.ask(TROUBLE) is None
        assert other.viewport() == list(SIZE)
    assert "ZeroDivisionError" in caplog.text
    assert bus.statistics.refused["internal"] == 1 + says_hello


def test_a_defect_in_reading_costs_one_connection_only(
    bus: splatbus_server.Bus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """[CHN-14]"""
    take = Service.take

    def fail(self: Service, peer: Any, data: bytes) -> None:
        assert b"trouble" not in data
        take(self, peer, data)

    monkeypatch.setattr(Service, "take", fail)
    with RawClient(bus.address.message_port) as first, RawClient(bus.address.message_port) as other:
        assert first.ask({"type": "trouble"}) is None
        assert other.viewport() == list(SIZE)
    assert "AssertionError" in caplog.text


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
    assert bus.next_view(0.0) is None
    with RawClient(bus.address.message_port) as mover:
        mover.send(camera_pose(0.5))
        assert eventually(lambda: bus._exchange.poses.camera.position[0] == 0.5)
