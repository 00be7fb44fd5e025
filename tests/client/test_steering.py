"""Poses and questions, over real sockets."""

import selectors
import socket
import threading

import pytest
from splatbus_client import (
    Pose,
    connect,
    message_protocol,
)
from splatbus_wire.errors import ProtocolError

from tests.peers.fake_server import (
    CAMERA_REPLY,
    HEIGHT,
    POSITION,
    ROTATION,
    WIDTH,
    frame,
)

POSE = Pose(POSITION, ROTATION)
OTHER = Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))


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
    message.send({"type": "camera", "id": request["id"]} | CAMERA_REPLY)
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


def test_a_reply_that_is_withheld_closes_that_channel_only(server, memory, monkeypatch):
    monkeypatch.setattr(message_protocol, "REPLY_SECONDS", 0.3)
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        ipc = server.ipc_opened(memory)
        message = server.message()
        answer = session.ask_camera_pose(0)
        assert message.ended()
        message = server.message_1_1()
        request = message.receive()
        message.send({"type": "camera", "id": request["id"]} | CAMERA_REPLY)
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
