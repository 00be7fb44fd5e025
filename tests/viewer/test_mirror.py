"""A copy of the newest image, over real sockets and real shared memory."""

import os
import sys

import pytest
from splatbus_client.reading import Reading
from splatbus_viewer.mirror import Mirror

from tests.peers.fake_server import frame


def test_a_copy_that_the_server_may_have_written_over_is_dropped(
    server, session, memory, monkeypatch
):
    server.ipc_opened(memory).send(frame(7))
    mirror = Mirror(session)
    monkeypatch.setattr("splatbus_client.lease.FrameLease.intact", property(lambda self: False))
    mirror.read(5)
    assert mirror.newest is None


@pytest.mark.skipif(sys.platform != "linux", reason="memory keeps its size elsewhere")
def test_an_image_whose_memory_is_cut_short_meanwhile_is_dropped(
    server, session, memory, monkeypatch
):
    hold = Reading.hold

    def cut_then(reading):
        loan = hold(reading)
        os.truncate(memory.path, 0)
        return loan

    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    mirror = Mirror(session)
    mirror.read(5)
    monkeypatch.setattr(Reading, "hold", cut_then)
    ipc.send(frame(8))
    mirror.read(5)
    assert mirror.newest.seq == 7
    ipc.receive_type("closed")
