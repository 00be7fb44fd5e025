"""Poses, questions and figures, as a session sends them and tells of them, over real sockets."""

import selectors
import socket
import threading
import time

import pytest
from splatbus_client import (
    Intrinsics,
    NotOfferedError,
    Pose,
    ServerRefusedError,
    connect,
    message_protocol,
)
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import SetViewport

from tests.peers.fake_server import (
    CAMERA,
    CAMERA_REPLY,
    HEIGHT,
    LENS,
    MESSAGE_CAPABILITIES,
    POSITION,
    ROTATION,
    SCENE,
    TELEMETRY,
    WIDTH,
    frame,
)

POSE, LENS_SENT = Pose(POSITION, ROTATION), Intrinsics(**LENS)
OTHER = Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
BUSY = {"type": "error", "code": "busy", "message": "another client steers"}
TYPED_REPLY = {"type": "camera"} | CAMERA_REPLY


def answered(message, future, reply=TYPED_REPLY):
    """What comes of a question that the server answers so; it has read all that came before."""
    message.send(reply | {"id": message.receive()["id"]})
    return future.result(5)


def served(message, kind, reply, call):
    """What a call returns that waits for the answer of a server which plays along."""

    def play():
        request = message.receive_type(kind)
        message.send(reply(request) | {"id": request["id"]})

    player = threading.Thread(target=play)
    player.start()
    found = call()
    player.join()
    return found


def test_what_a_session_sends_is_what_its_caller_says(server, session):
    message = server.message_1_1()
    assert tuple(message.hello["capabilities"]) == MESSAGE_CAPABILITIES
    session.send_camera(POSE, tag="a-1", intrinsics=LENS_SENT)
    camera = message.receive()
    assert (camera["type"], camera["tag"], camera["intrinsics"]) == ("camera_pose", "a-1", LENS)
    assert list(camera["position"].values()) == list(POSITION)
    assert list(camera["rotation"].values()) == list(ROTATION)
    session.send_object(POSE)
    cloud = message.receive()
    assert cloud["type"] == "point_cloud_pose"
    assert camera["timestamp"] <= cloud["timestamp"]
    session.send_object(POSE, "chair", 0.5)
    chair = message.receive()
    assert (chair["type"], chair["object"], chair["scale"]) == ("object_pose", "chair", 0.5)
    session.send_time(1.25)
    assert message.receive() == {"type": "set_time", "time": 1.25}
    assert session.status.no_effect is None
    assert session.status.message.capabilities == set(MESSAGE_CAPABILITIES)


def test_what_may_not_be_sent_is_refused_at_once(session):
    with pytest.raises(ProtocolError, match="norm"):
        session.send_camera(Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0)))
    with pytest.raises(ProtocolError, match="VPT-1"):
        session.set_viewport(0, 6, 5)


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


def test_the_newest_of_each_is_sent_again_after_a_reconnect_but_no_tag(server, session):
    message = server.message_1_1()
    session.send_camera(OTHER, tag="a-1", intrinsics=LENS_SENT)
    for name, scale in [("chair", 1.0), ("table", 1.0), ("chair", 0.5)]:
        session.send_object(POSE, name, scale)
    session.send_time(1.0)
    session.send_time(2.0)
    session.send_camera(POSE, tag="a-2")
    session.subscribe_telemetry(["loss"])
    message.receive_type("subscribe_telemetry")
    message.close()
    message = server.message_1_1()
    table, chair, moment, camera, figures = (message.receive() for _ in range(5))
    assert (table["object"], chair["object"], chair["scale"]) == ("table", "chair", 0.5)
    assert moment["time"] == 2.0
    assert camera["intrinsics"] == LENS, "they were in force, though another pose brought them"
    assert "tag" not in camera
    assert camera["position"]["y"] == -2.0
    assert figures["names"] == ["loss"]


def test_the_newest_pose_waits_for_its_first_connection_and_so_does_its_tag(server):
    server.stop()
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        session.send_camera(OTHER, tag="a-0")
        session.send_camera(POSE, tag="a-1")
        server.start()
        message = server.message_1_1()
        camera = message.receive()
        assert (camera["tag"], camera["position"]["y"]) == ("a-1", -2.0)
        message.close()
        assert "tag" not in server.message_1_1().receive()


def test_what_the_server_does_not_offer_is_not_sent_and_said_once(server, session, caplog):
    session.send_object(POSE, "chair")
    assert session.status.no_effect is None
    message = server.message_1_1(capabilities=())
    for _ in range(3):
        session.send_object(POSE, "chair")
        session.send_time(1.0)
    session.send_object(POSE)
    assert message.receive()["type"] == "point_cloud_pose"
    assert session.status.no_effect == "the server does not offer 'objects', 'time' [NEG-5]"
    assert caplog.text.count("does not offer 'objects'") == 1


@pytest.mark.parametrize(
    "call",
    [
        lambda session: session.scene(5),
        lambda session: session.set_viewport(8, 6, 5),
        lambda session: session.ping(5),
        lambda session: session.next_telemetry(5),
    ],
)
@pytest.mark.parametrize("early", [True, False])
def test_a_call_that_cannot_be_served_fails_at_once(server, session, call, early):
    def play():
        server.message_1_1(capabilities=())

    player = threading.Thread(target=play)
    player.start()
    while not early and session.status.message.version is None:
        time.sleep(0.005)
    with pytest.raises(NotOfferedError, match="NEG-5"):
        call(session)
    player.join()


def test_questions_are_answered(server, session):
    message = server.message_1_1((0, 0))
    assert answered(message, session.ask_camera_pose(2)) == POSE
    scene = served(message, "get_scene", lambda request: SCENE, lambda: session.scene(5))
    assert scene.objects[0].bounds.max == (4.0, 1.0, 4.0)
    assert (scene.objects[1].bounds, scene.cameras) == (None, 3)
    with_lens = TYPED_REPLY | {"intrinsics": LENS}
    camera = served(
        message, "get_camera_pose", lambda request: with_lens, lambda: session.camera(0, 5)
    )
    assert (camera.pose, camera.intrinsics) == (POSE, LENS_SENT)
    size = {"type": "viewport_size", "viewport_size": [8, 6]}
    wanted = served(
        message, "set_viewport", lambda request: size, lambda: session.set_viewport(8, 6, 5)
    )
    assert wanted == (8, 6)
    sample = served(
        message,
        "ping",
        lambda ping: {"type": "pong", "t": ping["t"], "serverTime": ping["t"] + 1000},
        lambda: session.ping(5),
    )
    assert sample.round_trip > 0
    assert abs(sample.ahead - 1000) <= sample.error + 1e-9


def test_a_question_may_be_refused(server, session):
    message = server.message_1_1()
    with pytest.raises(ServerRefusedError, match="busy") as caught:
        answered(message, session.ask(SetViewport(9, 6)), BUSY)
    assert caught.value.error.code == "busy"
    assert session.status.no_effect is None, "it was about the size"


def test_a_size_that_the_server_does_not_know_is_asked_for_again(server, session):
    message = server.message_1_1((0, 0))
    sizes = []
    asker = threading.Thread(target=lambda: sizes.append(session.viewport_size(10)))
    asker.start()
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
        assert answered(server.message_1_1(), answer) == POSE, "asked again on the next connection"
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


def test_busy_is_told_until_an_image_with_a_tag_of_ours_comes_or_its_connection_ends(
    server, session, memory
):
    ipc, message = server.ipc_opened(memory), server.message_1_1()
    session.send_camera(POSE, tag="ours-1")
    message.receive()
    message.send(BUSY)
    for seq, tag in [(1, "theirs-7"), (2, None), (3, "ours-1")]:
        camera = CAMERA if tag is None else CAMERA | {"tag": tag}
        answered(message, session.ask_camera_pose(0))
        assert "another client has control" in session.status.no_effect
        ipc.send(frame(seq, camera=camera))
        with session.next_frame(5) as lease:
            assert lease.camera.tag == tag
    assert session.status.no_effect is None
    message.send(BUSY)
    answered(message, session.ask_camera_pose(0))
    assert session.status.no_effect is not None
    message.close()
    server.message_1_1().receive_type("camera_pose")
    assert session.status.no_effect is None


def test_telemetry_is_queued_and_the_oldest_dropped(server, session):
    message = server.message_1_1()
    session.subscribe_telemetry()
    assert message.receive() == {"type": "subscribe_telemetry", "names": None}
    with pytest.raises(TimeoutError, match="has not answered"):
        session.next_telemetry(0.01)
    message.send(*(TELEMETRY | {"seq": seq} for seq in range(300)))
    answered(message, session.ask_camera_pose(0))
    assert [session.next_telemetry(5).seq for _ in range(256)] == list(range(44, 300))
