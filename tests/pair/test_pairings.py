"""Every pairing of 1.0 and 1.1, over real sockets, with all that crosses on record and judged."""

from __future__ import annotations

import pytest
import splatbus_client
from splatbus_client import Pose
from splatbus_schemas import names

from tests.pair.legacy import replay, server_of_1_0
from tests.pair.painting import painter
from tests.pair.rig import MOST_SECONDS, serving
from tests.peers.legacy_server import POSITION, ROTATION
from tests.waiting import eventually

MESSAGES_OF_1_0 = {name for name in names("1.0") if not name.endswith(("_reply", "packet"))}


def test_a_client_of_1_1_falls_back_without_a_timer() -> None:
    with server_of_1_0() as tap, tap.session() as session:
        session.send_camera(Pose((0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 1.0)))
        assert session.viewport_size(MOST_SECONDS) == (64, 48)
        assert session.camera_pose(0, MOST_SECONDS) == Pose(tuple(POSITION), tuple(ROTATION))
        assert session.status.message.version == "1.0"
        assert eventually(lambda: session.status.ipc.version == "1.0"), "an init packet of 1.0"
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
        assert eventually(lambda: bus.statistics.poses_received), "a pose"
    found = tap.judged()
    assert [f for f in found.of("server") if f.broken] == []


def test_swapped_ports_are_suspected_at_both_ends(caplog: pytest.LogCaptureFixture) -> None:
    with serving(painter()) as (bus, _):
        ports = bus.address.message_port, bus.address.ipc_port
        with splatbus_client.connect(None, *ports) as session:
            assert eventually(lambda: "two ports swapped?" in (session.status.no_images or ""))
            asked = "which belongs on the message channel: are the two ports swapped?"
            with pytest.raises(TimeoutError):
                session.viewport_size(0.1)
            assert eventually(lambda: asked in (session.status.message.problem or ""))
    assert "grants none of host_shm, frames, " in caplog.text
