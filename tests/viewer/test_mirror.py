"""A copy of the newest image, over real sockets and real shared memory."""

import os
import sys

import numpy as np
import pytest
from splatbus_client import connect
from splatbus_client.reading import Reading
from splatbus_viewer.mirror import Mirror

from tests.peers.fake_server import frame, image, init_packet


def test_the_newest_image_is_copied_and_given_back(server, session, memory):
    color, depth = image(1)
    memory.write(2, color, depth)
    ipc = server.ipc_opened(memory)
    mirror = Mirror(session)
    assert mirror.newest is None
    ipc.send(frame(7, slot=2))
    mirror.read(5)
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    memory.write(2, *image(2))
    assert mirror.newest.seq == 7
    np.testing.assert_array_equal(mirror.newest.color, color)
    np.testing.assert_array_equal(mirror.newest.depth, depth)


def test_without_a_new_image_the_former_stays(server, session, memory):
    server.ipc_opened(memory).send(frame(7))
    mirror = Mirror(session)
    mirror.read(5)
    mirror.read(0.01)
    assert mirror.newest.seq == 7


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


def test_a_channel_that_was_not_subscribed_to_is_not_copied(server, memory):
    where = ("127.0.0.1", server.ipc_port, server.message_port)
    with connect(*where, channels=["color"]) as session:
        ipc = server.ipc_1_1("host_shm", "frames", "subscribe")
        ipc.receive_type("subscribe")
        ipc.send(init_packet(memory.name))
        ipc.receive_type("opened")
        ipc.send(frame(7))
        mirror = Mirror(session)
        mirror.read(5)
        assert mirror.newest.color is not None
        assert mirror.newest.depth is None


def test_the_end_of_the_session_ends_the_reading(session):
    mirror = Mirror(session)
    session.close()
    with pytest.raises(RuntimeError, match="closed"):
        mirror.read(0.1)
