"""A session against a server that the test plays, over real sockets and real shared memory."""

import logging
import selectors
import socket
import threading
import time

import numpy as np
import pytest
from splatbus_client import Pose, ServerRefusedError, connect, message_protocol
from splatbus_wire.errors import ProtocolError

from tests.client.fake_server import (
    HEIGHT,
    SIZE,
    WIDTH,
    Memory,
    cuda_init_packet,
    frame,
    init_packet,
    packet,
)

POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))
OTHER = Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
CAMERA = {"position": list(POSE.position), "rotation": list(POSE.rotation)}


def image(seed):
    """Top-down colour and depth that no other seed has."""
    values = np.random.default_rng(seed).random((HEIGHT, WIDTH, 5), np.float32)
    return values[..., :4], values[..., 4] + 1


def opened(server, memory, generation=1):
    ipc = server.ipc_1_1()
    ipc.send(init_packet(memory.name, generation))
    assert ipc.receive() == {"type": "opened", "generation": generation}
    return ipc


# Frames


def test_a_frame_is_read_top_down_and_released(server, session, memory):
    color, depth = image(1)
    memory.write(2, color, depth)
    ipc = opened(server, memory)
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


def test_a_frame_is_released_even_if_its_reader_fails(server, session, memory):
    ipc = opened(server, memory)
    ipc.send(frame(7))
    with pytest.raises(ZeroDivisionError), session.next_frame(5):
        _ = 1 / 0
    assert ipc.receive()["type"] == "release"


def test_one_frame_is_borrowed_at_a_time(server, session, memory):
    opened(server, memory).send(frame(7))
    with session.next_frame(5), pytest.raises(RuntimeError, match="release the former"):
        session.next_frame(0)


def test_a_lease_ends_with_its_connection_but_its_memory_stays_readable(server, session, memory):
    color, depth = image(1)
    memory.write(0, color, depth)
    ipc = opened(server, memory)
    ipc.send(frame(7))
    with session.next_frame(5) as lease:
        ipc.close()
        server.ipc_1_1()
        assert not lease.intact
        np.testing.assert_array_equal(lease.color, color)


def test_a_frame_that_nobody_took_is_gone_with_its_connection(server, session, memory):
    ipc = opened(server, memory)
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
        opened(server, memory).send(frame(7))
        with session.next_frame(5) as lease, pytest.raises(ValueError, match="read-only"):
            lease.color[:] = 0
    assert memory.path.read_bytes() == before


def test_new_memory_replaces_old_once_the_old_is_read_no_more(server, session, memory):
    color, depth = image(1)
    memory.write(0, color, depth)
    ipc = opened(server, memory)
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
    ipc = opened(server, memory)
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
    ipc = opened(server, memory)
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
            with pytest.raises(RuntimeError, match="IMG-22"):
                _ = lease.depth
            session.subscribe("depth")
            assert ipc.receive() == {"type": "subscribe", "channels": ["depth"]}
        ipc.send(frame(8))
        with session.next_frame(5) as lease:
            assert lease.depth.shape == (HEIGHT, WIDTH)


# Memory that cannot be opened


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
    server.message_1_1()
    assert session.viewport_size(5) == (WIDTH, HEIGHT)


# Poses and questions


def test_poses_are_sent_in_the_order_of_the_axes_with_timestamps(server, session):
    message = server.message_1_1()
    session.send_camera(POSE)
    session.send_object(POSE)
    camera, cloud = message.receive(), message.receive()
    assert list(camera) == ["type", "timestamp", "position", "rotation"]
    assert list(camera["position"]) == ["x", "y", "z"]
    assert list(camera["rotation"]) == ["x", "y", "z", "w"]
    assert camera["rotation"]["w"] == 0.9273618495495703
    assert (camera["type"], cloud["type"]) == ("camera_pose", "point_cloud_pose")
    assert camera["timestamp"] <= cloud["timestamp"]


def test_the_newest_pose_waits_for_a_connection(server, session):
    server.stop()
    for pose in (OTHER, POSE):
        session.send_camera(pose)
    server.start()
    message = server.message()
    types = [message.receive()["type"] for _ in range(2)]
    assert types == ["hello", "get_viewport_size"]
    assert message.receive()["position"]["y"] == -2.0


def test_a_pose_that_may_not_be_sent_is_refused_at_once(session):
    with pytest.raises(ProtocolError, match="norm"):
        session.send_camera(Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0)))


def test_sending_never_waits_for_a_server_that_does_not_read(server, session):
    message = server.message_1_1()
    channel = session._message
    channel.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    while not channel.interest() & selectors.EVENT_WRITE:
        session.send_camera(OTHER)
    session.send_camera(OTHER)
    session.send_camera(POSE)
    last = {}
    while last.get("position", {}).get("y") != -2.0:
        last = message.receive()


def test_questions_are_answered(server, session):
    message = server.message_1_1((0, 0))
    answer = session.ask_camera_pose(2)
    request = message.receive()
    assert (request["type"], request["cam_idx"]) == ("get_camera_pose", 2)
    message.send({"type": "camera", "id": request["id"]} | CAMERA)
    assert answer.result(5) == POSE


def test_a_size_that_the_server_does_not_know_is_asked_for_again(server, session):
    server.message_1_1((0, 0))
    sizes = []
    asker = threading.Thread(target=lambda: sizes.append(session.viewport_size(10)))
    asker.start()
    message = server._peers[-1]
    for size in ([0, 0], [0, 0], [WIDTH, HEIGHT]):
        request = message.receive()
        message.send({"type": "viewport_size", "id": request["id"], "viewport_size": size})
    asker.join()
    assert sizes == [(WIDTH, HEIGHT)]


def test_a_server_of_1_0_is_asked_in_its_own_words(server, session):
    message = server.message()
    assert message.receive()["type"] == "hello"
    assert message.receive() == {"type": "get_viewport_size"}
    message.send({"viewport_size": [WIDTH, HEIGHT]})
    answer = session.ask_camera_pose(-1)
    assert message.receive() == {"type": "get_camera_pose", "cam_idx": -1}
    message.send(CAMERA)
    assert answer.result(5) == POSE
    assert session.status.message.version == "1.0"


def test_an_error_that_answers_a_question_is_raised(server, session):
    message = server.message_1_1()
    answer = session.ask_camera_pose(0)
    identifier = message.receive()["id"]
    error = {"type": "error", "code": "internal", "message": "out of cameras", "id": identifier}
    message.send(error)
    with pytest.raises(ServerRefusedError, match="out of cameras"):
        answer.result(5)


def test_a_reply_that_is_withheld_closes_that_channel_only(server, memory, monkeypatch):
    monkeypatch.setattr(message_protocol, "REPLY_SECONDS", 0.3)
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        ipc = opened(server, memory)
        message = server.message()
        answer = session.ask_camera_pose(0)
        assert message.ended()
        message = server.message_1_1()
        request = message.receive()
        message.send({"type": "camera", "id": request["id"]} | CAMERA)
        assert answer.result(5) == POSE, "asked again on the next connection"
        ipc.send(frame(1))
        with session.next_frame(5) as lease:
            assert lease.intact


def test_a_question_nobody_waits_for_any_more_is_not_asked_again(server, session):
    server.stop()
    with pytest.raises(TimeoutError):
        session.camera_pose(0, 0.01)
    server.start()
    message = server.message_1_1()
    session.send_camera(POSE)
    assert message.receive()["type"] == "camera_pose"


# Connections


def test_a_client_that_is_early_finds_its_server(server, memory):
    server.stop()
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        with pytest.raises(TimeoutError, match="splatbus-server"):
            session.next_frame(0.2)
        with pytest.raises(TimeoutError, match="splatbus-server"):
            session.viewport_size(0.2)
        server.start()
        opened(server, memory).send(frame(1))
        with session.next_frame(5):
            pass


def test_a_client_survives_its_server_s_restart(server, session, memory):
    opened(server, memory).send(frame(1))
    server.message_1_1()
    session.send_camera(POSE)
    with session.next_frame(5):
        pass
    server.stop()
    memory.remove()
    server.start()
    other = Memory()
    try:
        color, depth = image(2)
        other.write(1, color, depth)
        opened(server, other).send(frame(1, slot=1))
        with session.next_frame(5) as lease:
            np.testing.assert_array_equal(lease.color, color)
        assert server.message_1_1().receive()["type"] == "camera_pose", "the pose is sent again"
    finally:
        other.remove()
    assert session.status.ipc.connections == 2


@pytest.mark.parametrize("end", ["reset", "close"])
def test_one_channel_s_loss_leaves_the_other_alone(server, session, memory, end):
    ipc = opened(server, memory)
    for _ in range(3):
        getattr(server.message_1_1(), end)()
    ipc.send(frame(1))
    with session.next_frame(5) as lease:
        assert lease.intact
    message = server.message_1_1()
    for _ in range(3):
        getattr(ipc, end)()
        ipc = opened(server, memory)
    session.send_camera(POSE)
    assert message.receive()["type"] == "camera_pose"


def test_half_a_packet_never_continues_on_the_next_connection(server, session, memory):
    whole = packet(init_packet(memory.name))
    ipc = server.ipc_1_1()
    ipc.socket.sendall(whole[:200])
    ipc.close()
    ipc = server.ipc_1_1()
    ipc.socket.sendall(whole)
    assert ipc.receive() == {"type": "opened", "generation": 1}


@pytest.mark.parametrize("payload", [b"\xff", b"[1]", b'{"meta":{}}', b"null", b'{"a":NaN}'])
def test_broken_packets_are_ignored(server, session, memory, payload):
    ipc, message = server.ipc_1_1(), server.message_1_1()
    ipc.send(payload, init_packet(memory.name))
    assert ipc.receive() == {"type": "opened", "generation": 1}
    message.send(payload)
    answer = session.ask_camera_pose(0)
    request = message.receive()
    message.send(payload, {"type": "camera", "id": request["id"]} | CAMERA)
    assert answer.result(5) == POSE


def test_a_bad_header_closes_and_a_new_connection_is_made(server, session):
    for accept in (server.ipc, server.message):
        peer = accept()
        peer.socket.sendall(b"\xff\xff\xff\xff")
        assert peer.ended()
        accept()


def test_the_end_of_a_session_ends_both_connections(server):
    session = connect("127.0.0.1", server.ipc_port, server.message_port)
    ipc, message = server.ipc(), server.message()
    session.close()
    session.close()
    assert ipc.ended()
    assert message.ended()
    for call in (session.ask_viewport_size, lambda: session.next_frame(1)):
        with pytest.raises(RuntimeError, match="closed"):
            call()
    with pytest.raises(RuntimeError, match="closed"):
        session.send_camera(POSE)


def test_a_frame_may_be_released_after_the_session(server, memory):
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        opened(server, memory).send(frame(7))
        lease = session.next_frame(5)
    lease.release()


@pytest.mark.parametrize("wait", ["next_frame", "viewport_size"])
def test_closing_wakes_whoever_waits(server, session, wait):
    problems = []

    def waiting():
        try:
            getattr(session, wait)(60)
        except RuntimeError as problem:
            problems.append(str(problem))

    waiter = threading.Thread(target=waiting)
    waiter.start()
    session.close()
    waiter.join(10)
    assert problems == ["the session is closed"]


def test_a_token_is_said_on_both_channels_and_never_logged(server, caplog):
    caplog.set_level(logging.DEBUG)
    ports = server.ipc_port, server.message_port
    with connect("127.0.0.1", *ports, token="open sesame"):
        assert server.ipc().receive()["token"] == "open sesame"
        assert server.message().receive()["token"] == "open sesame"
    assert "sesame" not in caplog.text


def test_unknown_channels_are_refused():
    with pytest.raises(ValueError, match="IMG-19"):
        connect(channels=["normals"])


def test_what_the_server_says_when_it_turns_us_away_is_told(server, session, caplog):
    ipc = server.ipc()
    ipc.receive()
    ipc.send({"type": "error", "code": "unauthorized", "message": "a token is required"})
    ipc.close()
    server.ipc()
    assert "unauthorized" in caplog.text
