"""Memory and leases, over real sockets and real shared memory."""

import logging
import os
import sys
import time

import numpy as np
import pytest
from splatbus_client import MemoryLostError, connect

from tests.peers.fake_server import (
    CAMERA,
    HEIGHT,
    SIZE,
    WIDTH,
    Memory,
    cuda_init_packet,
    frame,
    image,
    init_packet,
)

linux = pytest.mark.skipif(sys.platform != "linux", reason="memory keeps its size elsewhere")


def test_a_frame_is_read_top_down_and_released(server, session, memory):
    color, depth = image(1)
    memory.write(2, color, depth)
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7, slot=2))
    with session.next_frame(5) as lease:
        np.testing.assert_array_equal(lease.color, color)
        np.testing.assert_array_equal(lease.depth, depth)
        assert lease.camera.pose.position == (0.0, 0.0, -4.0)
        assert lease.intact
        assert not lease.color.flags.writeable
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    assert not lease.intact
    with pytest.raises(RuntimeError, match="IMG-14"):
        _ = lease.color


def test_what_was_announced_can_be_asked(server, session, memory):
    assert session.images is None
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        assert lease.channels == {"color", "depth"}
    assert session.images[:3] == (1, WIDTH, HEIGHT)
    assert session.images.semantics.alpha == "straight"


def test_a_frame_is_released_even_if_its_reader_fails(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with pytest.raises(ZeroDivisionError), session.next_frame(5):
        _ = 1 / 0
    assert ipc.receive()["type"] == "release"


def test_a_frame_of_another_size_than_its_memory_is_given_back_unread(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7, camera=CAMERA | {"width": 100}))
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    ipc.send(frame(8))
    with session.next_frame(5) as lease:
        assert lease.seq == 8


@linux
def test_memory_that_is_cut_before_a_frame_is_taken_is_closed_and_the_next_read(
    server, session, memory
):
    ipc = server.ipc_opened(memory)
    os.truncate(memory.path, 0)
    ipc.send(frame(7))
    with pytest.raises(TimeoutError, match=r"cut to 0 bytes.*MEM-5"):
        session.next_frame(0.5)
    answers = [ipc.receive() for _ in range(2)]
    assert answers[0] == {"type": "release", "generation": 1, "seq": 7}
    assert answers[1] == {"type": "closed", "generation": 1}
    assert session.images is None
    other = Memory()
    try:
        ipc.send(init_packet(other.name, generation=2))
        assert ipc.receive() == {"type": "opened", "generation": 2}
        ipc.send(frame(8, generation=2))
        with session.next_frame(5) as lease:
            assert lease.seq == 8
    finally:
        other.remove()


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
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    assert ipc.receive() == {"type": "closed", "generation": 1}
    assert "MEM-5" in session.status.no_images


@linux
def test_memory_that_was_cut_by_the_time_a_frame_is_given_back_is_closed(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5):
        os.truncate(memory.path, 0)
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    assert ipc.receive() == {"type": "closed", "generation": 1}


@linux
def test_a_frame_that_follows_in_memory_that_was_cut_is_given_back_unread(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        kept = lease.color  # which keeps it mapped
        os.truncate(memory.path, 0)
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
    ipc.send(frame(8))
    assert ipc.receive() == {"type": "release", "generation": 1, "seq": 8}
    del kept
    assert ipc.receive() == {"type": "closed", "generation": 1}


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


def test_one_frame_is_borrowed_at_a_time(server, session, memory):
    server.ipc_opened(memory).send(frame(7))
    with session.next_frame(5), pytest.raises(RuntimeError, match="release the former"):
        session.next_frame(0)


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


def test_memory_is_neither_removed_nor_written(server, memory):
    color, depth = image(1)
    memory.write(0, color, depth)
    before = memory.path.read_bytes()
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        server.ipc_opened(memory).send(frame(7))
        with session.next_frame(5) as lease, pytest.raises(ValueError, match="read-only"):
            lease.color[:] = 0
    assert memory.path.read_bytes() == before


def test_new_memory_replaces_old_once_the_old_is_read_no_more(server, session, memory):
    color, depth = image(1)
    memory.write(0, color, depth)
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    larger = Memory()
    try:
        with session.next_frame(5) as lease:
            ipc.send(init_packet(larger.name, generation=2))
            assert ipc.receive() == {"type": "opened", "generation": 2}
            np.testing.assert_array_equal(lease.color, color)
        assert ipc.receive() == {"type": "release", "generation": 1, "seq": 7}
        assert ipc.receive() == {"type": "closed", "generation": 1}
        ipc.send(frame(8, generation=2))
        with session.next_frame(5) as lease:
            assert lease.seq == 8
            assert not lease.color.any()
    finally:
        larger.remove()


def test_closed_never_overtakes_the_release_of_a_reader_that_let_go(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    lease = session.next_frame(5)
    ipc.send(init_packet(memory.name, generation=2))
    assert ipc.receive() == {"type": "opened", "generation": 2}
    lease._color = lease._depth = None
    ipc.send(init_packet(memory.name, generation=3))
    assert [ipc.receive() for _ in range(2)] == [
        {"type": "opened", "generation": 3},
        {"type": "closed", "generation": 2},
    ]
    lease.release()
    assert [ipc.receive()["type"] for _ in range(2)] == ["release", "closed"]


def test_closed_waits_for_arrays_that_outlived_their_frame(server, session, memory):
    ipc = server.ipc_opened(memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        kept = lease.color
    ipc.send(init_packet(memory.name, generation=2), init_packet(memory.name, generation=3))
    answers = [ipc.receive() for _ in range(4)]
    assert {"type": "closed", "generation": 2} in answers
    assert {"type": "closed", "generation": 1} not in answers
    assert not kept.any()
    del kept
    assert ipc.receive() == {"type": "closed", "generation": 1}


def test_a_channel_that_was_not_subscribed_to_is_not_read(server, memory):
    ports = server.ipc_port, server.message_port
    with connect("127.0.0.1", *ports, channels=["color"]) as session:
        ipc = server.ipc_1_1()
        assert ipc.receive() == {"type": "subscribe", "channels": ["color"]}
        ipc.send(init_packet(memory.name))
        ipc.receive_type("opened")
        ipc.send(frame(7))
        with session.next_frame(5) as lease:
            assert lease.color.shape == (HEIGHT, WIDTH, 4)
            for read in (lambda lease: lease.depth, lambda lease: lease.copy("depth")):
                with pytest.raises(RuntimeError, match="IMG-22"):
                    read(lease)
            session.subscribe("depth")
            assert ipc.receive() == {"type": "subscribe", "channels": ["depth"]}
        ipc.send(frame(8))
        with session.next_frame(5) as lease:
            assert lease.depth.shape == (HEIGHT, WIDTH)


@pytest.mark.parametrize(
    ("members", "reason"),
    [
        ({"name": "client-test-missing"}, "no shared memory"),
        ({"name": "../../etc/passwd"}, "MEM-7"),
        ({"name": "x" * 31}, "MEM-7"),
        ({"kind": "cuda_ipc"}, ""),
        ({"bytes": SIZE + 1}, "MEM-6"),
        ({"bytes": SIZE - 1}, "MEM-10"),
        ({"bytes": 2**53 - 1}, "MEM-6"),
    ],
)
def test_what_cannot_be_opened_is_declined_and_the_rest_goes_on(
    server, session, memory, members, reason
):
    ipc = server.ipc_1_1()
    announced = {"kind": "host_shm", "name": memory.name, "bytes": SIZE} | members
    ipc.send(init_packet(memory=announced))
    answer = ipc.receive()
    assert (answer["type"], answer["generation"]) == ("open_failed", 1)
    assert reason in answer["reason"]
    with pytest.raises(TimeoutError, match="cannot be opened"):
        session.next_frame(0)
    ipc.send(init_packet(memory.name, generation=2))
    assert ipc.receive() == {"type": "opened", "generation": 2}
    ipc.send(frame(1, generation=2))
    with session.next_frame(5):
        pass


def test_memory_of_1_0_is_declined_in_silence_and_said_once(server, session, caplog):
    caplog.set_level(logging.WARNING, "splatbus_client")
    for _ in range(2):
        ipc = server.ipc()
        assert ipc.receive()["type"] == "hello"
        ipc.send(cuda_init_packet(), cuda_init_packet())
        ipc.send(b"{}")
        ipc.socket.settimeout(0.3)
        with pytest.raises(TimeoutError):
            ipc.receive()
        ipc.close()
    assert sum("no CUDA support" in record.message for record in caplog.records) == 1
    message, size = server.message_1_1(), session.ask_viewport_size()
    asked = message.receive()
    message.send({"type": "viewport_size", "id": asked["id"], "viewport_size": [WIDTH, HEIGHT]})
    assert size.result(5) == (WIDTH, HEIGHT)
