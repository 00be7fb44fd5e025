"""Each code of `error` provoked once, and whether the connection goes on or closes."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import pytest
import splatbus_server.session
from splatbus_schemas import schema

from tests.pair.painting import painter
from tests.pair.rig import eventually, serving
from tests.pair.talk import Onlooker, Talker, object_pose
from tests.peers.raw_client import RawClient, camera_pose, hello

LENS = {"fx": 1.0, "fy": 1.0, "cx": 0.0, "cy": 0.0, "width": 1, "height": 999}
LENS |= {"near": 0.1, "far": 1.0}
GOES_ON: dict[str, Any] = {
    "malformed_json": b'{"type":',
    "not_an_object": b"[1, 2]",
    "unknown_type": {"type": "teleport"},
    "invalid_message": camera_pose(1.0, intrinsics=LENS),
    "invalid_number": camera_pose(1e39),
    "invalid_rotation": camera_pose(0.0, rotation={"x": 1.0, "y": 1.0, "z": 0.0, "w": 0.0}),
    "unknown_object": object_pose("nobody"),
    "unsupported": {"type": "set_time", "time": 1.0},
}
CLOSES: dict[str, Callable[[RawClient], None]] = {
    "malformed_packet": lambda c: c.socket.sendall(struct.pack("<I", 0)),
    "packet_too_large": lambda c: c.socket.sendall(struct.pack("<I", 1 << 21)),
}
CODES = set(schema("error", "1.1")["properties"]["code"]["enum"])
ELSEWHERE = {"busy", "internal", "unauthorized", "unsupported_version", "too_many_clients"}


def test_every_code_is_provoked_here() -> None:
    assert set(GOES_ON) | set(CLOSES) | ELSEWHERE == CODES


@pytest.mark.parametrize("code", GOES_ON)
def test_after_these_the_connection_goes_on(code: str) -> None:
    with serving(painter()) as (_, tap), Talker(tap) as client:
        client.send(GOES_ON[code])
        error = client.receive()
        assert error is not None
        assert (error["type"], error["code"]) == ("error", code)
        assert client.viewport() == [32, 24]


@pytest.mark.parametrize("code", CLOSES)
def test_after_these_it_closes(code: str) -> None:
    with serving(painter()) as (_, tap), Talker(tap) as client:
        CLOSES[code](client)
        error = client.receive()
        assert error is not None
        assert error["code"] == code
        assert client.receive() is None


def test_no_version_in_common() -> None:
    with serving(painter()) as (_, tap), RawClient(tap.ports["msg"]) as client:
        error = client.ask(hello(versions=["9.9"]))
        assert error is not None
        assert error["code"] == "unsupported_version"
        assert "1.1" in error["supported"]
        assert client.receive() is None


@pytest.mark.parametrize("channel", ["ipc", "msg"])
@pytest.mark.parametrize("token", [None, "wrong"])
def test_a_wrong_token_is_told_so_and_nothing_else(channel: str, token: str | None) -> None:
    said = {} if token is None else {"token": token}
    with serving(painter(), token="right") as (_, tap):
        with RawClient(tap.ports[channel]) as client:  # type: ignore[index]
            error = client.ask(hello("host_shm", "frames", **said))
            assert error is not None
            assert error["code"] == "unauthorized"
            assert client.receive() is None
        with tap.session(token="right") as session, session.next_frame(30.0):
            pass
    tap.assert_conforming()


def test_one_reader_too_many() -> None:
    with serving(painter(), readers=1) as (_, tap), Onlooker(tap) as first:
        first.open()
        with Onlooker(tap) as second:
            error = second.receive()
            assert error is not None
            assert error["code"] == "too_many_clients"
            assert second.receive() is None
        first.see(lambda f: True)


def test_busy() -> None:
    with serving(painter()) as (_, tap), Talker(tap) as first, Talker(tap) as second:
        first.send(camera_pose(1.0))
        first.said_since()
        second.send(camera_pose(2.0))
        assert (second.receive() or {})["code"] == "busy"
        second.send({"type": "set_viewport", "width": 8, "height": 6, "id": 77})
        error = second.receive() or {}
        assert (error["code"], error["id"]) == ("busy", 77)
        assert second.viewport() == [32, 24]


def test_a_defect_of_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says `internal` with the id of the request, and serves on, everybody."""

    def defective(*_: object) -> None:
        raise ZeroDivisionError

    with serving(painter()) as (_, tap), Talker(tap) as client:
        with monkeypatch.context() as patch:
            patch.setattr(splatbus_server.session, "Pong", defective)
            client.send({"type": "ping", "t": 1.0, "id": 5})
            error = client.receive() or {}
            assert (error["code"], error.get("id")) == ("internal", 5)
        assert (client.ask({"type": "ping", "t": 1.0, "id": 6}) or {})["type"] == "pong"


def test_requests_are_answered_in_order_with_their_ids() -> None:
    requests = [
        {"type": "ping", "t": 1.5, "id": 1},
        {"type": "get_scene", "id": 2},
        {"type": "set_viewport", "width": 64, "height": 48, "id": 3},
        {"type": "get_viewport_size", "id": 4},
        {"type": "get_camera_pose", "cam_idx": 0, "id": 5},
        {"type": "set_viewport", "width": 0, "height": 48, "id": 6},
        {"type": "ping", "t": 2.5, "id": 7},
    ]
    with serving(painter()) as (_, tap), Talker(tap) as client:
        client.send(*requests)
        replies = [client.receive() or {} for _ in requests]
        kinds = "pong scene viewport_size viewport_size camera error pong".split()
        assert [r["type"] for r in replies] == kinds
        assert [r["id"] for r in replies] == list(range(1, 8))
        assert [r["viewport_size"] for r in replies[2:4]] == [[64, 48], [64, 48]]
        assert replies[5]["pointer"] == "/width"
        eventually(lambda: client.viewport() == [64, 48], "the new size")
    assert [f.requirement.id for f in tap.judged().findings if f.broken] == ["VPT-1"]
