"""Deployed clients of 1.0, over real sockets, with all that crosses on record and judged."""

from __future__ import annotations

import pytest
import splatbus_client

from tests.pair.legacy import replay
from tests.pair.painting import painter
from tests.pair.rig import serving
from tests.waiting import eventually


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
