"""Memory and leases, over real sockets and real shared memory."""

import os
import sys
import time

import numpy as np
import pytest
from splatbus_client import MemoryLostError

from tests.peers.fake_server import (
    HEIGHT,
    SIZE,
    WIDTH,
    Memory,
    frame,
    image,
    init_packet,
)

linux = pytest.mark.skipif(sys.platform != "linux", reason="memory keeps its size elsewhere")


@pytest.fixture
def memories():
    """Makes shared memories that are removed at the end."""
    made = []

    def make():
        made.append(Memory())
        return made[-1]

    yield make
    for memory in made:
        memory.remove()


def reinit(ipc, memory, generation):
    ipc.send(init_packet(memory.name, generation))
    assert ipc.receive() == {"type": "opened", "generation": generation}


def release(seq, generation=1):
    return {"type": "release", "generation": generation, "seq": seq}


def closed(generation=1):
    return {"type": "closed", "generation": generation}


def test_a_frame_is_read_top_down_and_released(server, session, memory):
    color, depth = image(1)
    memory.write(2, color, depth)
    assert session.images is None
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7, slot=2))
    with session.next_frame(5) as lease:
        np.testing.assert_array_equal(lease.color, color)
        np.testing.assert_array_equal(lease.depth, depth)
        assert lease.camera.pose.position == (0.0, 0.0, -4.0)
        assert lease.channels == {"color", "depth"}
        assert lease.intact
        assert not lease.color.flags.writeable
        with pytest.raises(RuntimeError, match="release the former"):
            session.next_frame(0)
    assert ipc.receive() == release(7)
    assert not lease.intact
    with pytest.raises(RuntimeError, match="IMG-14"):
        _ = lease.color
    assert session.images[:3] == (1, WIDTH, HEIGHT)
    assert session.images.semantics.alpha == "straight"


@linux
def test_memory_that_is_cut_before_a_frame_is_taken_is_closed_and_the_next_read(
    server, session, memory, memories
):
    ipc = server.ipc_opened(memory)
    os.truncate(memory.path, 0)
    ipc.send(frame(7))
    with pytest.raises(TimeoutError, match=r"cut to 0 bytes.*MEM-5"):
        session.next_frame(0.5)
    assert [ipc.receive() for _ in range(2)] == [release(7), closed()]
    assert session.images is None
    reinit(ipc, memories(), 2)
    ipc.send(frame(8, generation=2))
    with session.next_frame(5) as lease:
        assert lease.seq == 8


@linux
def test_memory_that_is_cut_under_a_frame_fails_its_copy_and_is_closed(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        assert lease.copy("color").shape == (HEIGHT, WIDTH, 4)
        os.truncate(memory.path, 0)
        assert not lease.intact
        for channel in ("color", "depth"):
            with pytest.raises(MemoryLostError, match="MEM-5"):
                lease.copy(channel)
    assert [ipc.receive() for _ in range(2)] == [release(7), closed()]
    assert "MEM-5" in session.status.no_images


@linux
def test_memory_that_was_cut_ends_the_connection_where_nothing_else_can_be_said(
    server, session, memory, caplog
):
    ipc = server.ipc_1_1("host_shm", "frames")
    ipc.send(init_packet(memory.name))
    ipc.receive_type("opened")
    os.truncate(memory.path, 0)
    ipc.send(frame(7), frame(8))
    with pytest.raises(TimeoutError):
        session.next_frame(0.5)
    assert ipc.ended()
    assert "cut to 0 bytes" in caplog.text
    memory.path.write_bytes(bytes(SIZE))
    server.ipc_opened(memory).send(frame(1))
    with session.next_frame(5) as lease:
        assert lease.copy("depth").shape == (HEIGHT, WIDTH)


def test_a_lease_ends_with_its_connection_but_its_memory_stays_readable(server, session, memory):
    color, depth = image(1)
    memory.write(0, color, depth)
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        ipc.close()
        server.ipc_1_1()
        assert not lease.intact
        np.testing.assert_array_equal(lease.color, color)


def test_a_frame_that_nobody_took_is_gone_with_its_connection(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    while session._reading.lent is None:
        time.sleep(0.01)
    ipc.close()
    server.ipc_1_1()
    with pytest.raises(TimeoutError, match="no images yet"):
        session.next_frame(0.2)


def test_closed_waits_for_arrays_that_outlived_their_frame(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        kept = lease.color
    assert ipc.receive() == release(7)
    reinit(ipc, memory, 2)
    reinit(ipc, memory, 3)
    assert ipc.receive() == closed(2)
    assert not kept.any()
    del kept
    assert ipc.receive() == closed()


def test_what_cannot_be_opened_is_told_and_the_rest_goes_on(server, session, memory):
    ipc = server.ipc_1_1()
    ipc.send(init_packet())
    answer = ipc.receive()
    assert (answer["type"], answer["generation"]) == ("open_failed", 1)
    assert "no shared memory" in answer["reason"]
    with pytest.raises(TimeoutError, match="cannot be opened"):
        session.next_frame(0)
    reinit(ipc, memory, 2)
    ipc.send(frame(1, generation=2))
    with session.next_frame(5):
        pass


def test_a_frame_that_is_held_while_the_connection_changes_is_given_back_to_nobody(
    server, session, memories
):
    first, second = memories(), memories()
    ipc = server.ipc_opened(first)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        reinit(ipc, second, 2)
        ipc.close()
        ipc = server.ipc_opened(second)
        assert not lease.intact
    ipc.send(frame(1))
    with session.next_frame(5) as lease:
        assert lease.seq == 1
    assert ipc.receive() == release(1)
