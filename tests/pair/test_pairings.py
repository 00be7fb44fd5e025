"""Every pairing of 1.0 and 1.1, over real sockets, with all that crosses on record and judged."""

from __future__ import annotations

import pytest
from splatbus_client import Pose
from splatbus_schemas import names

from tests.pair.legacy import POSITION, ROTATION, packet, replay, server_of_1_0
from tests.pair.painting import is_whole, painter
from tests.pair.rig import MOST_SECONDS, eventually, serving

MESSAGES_OF_1_0 = {name for name in names("1.0") if not name.endswith(("_reply", "packet"))}


def test_both_of_1_1() -> None:
    with serving(painter()) as (_, tap), tap.session() as session:
        session.send_camera(Pose((0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 1.0)))
        with session.next_frame(MOST_SECONDS) as frame:
            assert is_whole(frame)
        assert session.viewport_size(MOST_SECONDS) == (32, 24)
        eventually(lambda: session.status.message.version == "1.1", "welcome")
    tap.assert_conforming()


def test_a_client_of_1_1_falls_back_without_a_timer() -> None:
    with server_of_1_0() as tap, tap.session() as session:
        session.send_camera(Pose((0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 1.0)))
        assert session.viewport_size(MOST_SECONDS) == (64, 48)
        assert session.camera_pose(0, MOST_SECONDS) == Pose(tuple(POSITION), tuple(ROTATION))
        assert session.status.message.version == "1.0"
        eventually(lambda: session.status.ipc.version == "1.0", "an init packet of 1.0")
        session.send_camera(Pose((0.0, 0.0, -2.0), (0.0, 0.0, 0.0, 1.0)))
        session.camera_pose(1, MOST_SECONDS)
    sent = tap.said("client", "msg")
    assert {message.type for message in sent} == MESSAGES_OF_1_0 - {"point_cloud_pose"} | {"hello"}
    assert [m.type for m in tap.said("client", "ipc")] == ["hello"]
    allowed = {"type", "timestamp", "position", "rotation", "cam_idx"}
    assert all(set(m.value or ()) <= allowed for m in sent if m.type != "hello")
    tap.assert_conforming()


@pytest.mark.parametrize("name", ["opengl-viewer", "python-client", "unity-csharp"])
def test_a_deployed_client_is_served_by_1_1(name: str) -> None:
    with serving(painter()) as (bus, tap):
        replies = replay(f"{name}.jsonl", tap)
        assert all(set(r) in ({"viewport_size"}, {"position", "rotation"}) for r in replies)
        eventually(lambda: bus.statistics.poses_received, "a pose")
    found = tap.judged()
    assert [f for f in found.of("server") if f.broken] == []


def test_a_client_of_1_0_is_sent_nothing_on_the_ipc_channel() -> None:
    import socket

    with serving(painter()) as (_, tap):
        address = ("127.0.0.1", tap.ports["ipc"])
        with socket.create_connection(address, timeout=0.5) as silent, tap.session() as other:
            with other.next_frame(MOST_SECONDS) as frame:  # a client of 1.1 beside it is served
                assert is_whole(frame)
            with pytest.raises(TimeoutError):
                silent.recv(1)
    tap.assert_conforming()


def test_who_does_not_know_what_comes_next_is_not_disturbed() -> None:
    """Capabilities, types and members of a version to come change nothing."""
    import socket

    hello = {
        "type": "hello",
        "versions": ["7.3", "1.1"],
        "client": {"name": "of the future", "version": "9", "mood": "good"},
        "capabilities": ["telepathy", "ping", "scene"],
        "extra": {"type": "bye"},
    }
    with serving(painter()) as (_, tap), tap.session() as session:
        address = ("127.0.0.1", tap.ports["msg"])
        with socket.create_connection(address, timeout=MOST_SECONDS) as future:
            stream = future.makefile("rb")
            future.sendall(packet(hello) + packet({"type": "teleport", "to": [1, 2]}))
            future.sendall(packet({"type": "ping", "t": 1.5, "id": 3, "because": None}))
            received = b""
            while b"pong" not in received:
                received += stream.read1(65536)
            stream.close()
        with session.next_frame(MOST_SECONDS) as frame:
            assert is_whole(frame)
    assert b"telepathy" not in received
    answers = [m.type for m in tap.said("server", "msg")]
    assert {"welcome", "error", "pong"} >= set(answers) - {"viewport_size"}
