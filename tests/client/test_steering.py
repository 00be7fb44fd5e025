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
)
from splatbus_wire.messages import GetScene, SetViewport

from tests.peers.fake_server import (
    CAMERA,
    CAMERA_REPLY,
    LENS,
    MESSAGE_CAPABILITIES,
    POSE,
    SCENE,
    TELEMETRY,
    frame,
)

LENS_SENT = Intrinsics(**LENS)
OTHER = Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
BUSY = {"type": "error", "code": "busy", "message": "another client steers"}
TYPED_REPLY = {"type": "camera"} | CAMERA_REPLY
WITH_LENS = TYPED_REPLY | {"intrinsics": LENS}
TYPED_SIZE = {"type": "viewport_size", "viewport_size": [8, 6]}


def answered(message, future, reply=TYPED_REPLY):
    """What comes of a question that the server answers so; it has read all that came before."""
    message.send(reply | {"id": message.receive()["id"]})
    return future.result(5)


def test_what_a_session_sends_is_what_its_caller_says(server, session):
    message = server.message_1_1()
    assert tuple(message.hello["capabilities"]) == MESSAGE_CAPABILITIES
    session.send_camera(POSE, tag="a-1", intrinsics=LENS_SENT)
    camera = message.receive()
    assert (camera["type"], camera["tag"], camera["intrinsics"]) == ("camera_pose", "a-1", LENS)
    assert list(camera["position"].values()) == list(POSE.position)
    assert list(camera["rotation"].values()) == list(POSE.rotation)
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
    for lens in (LENS_SENT._replace(fx=1.0), LENS_SENT):
        session.send_camera(OTHER, tag="a-1", intrinsics=lens)
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


def test_questions_are_answered_on_the_next_connection_if_need_be(server, session):
    message = server.message_1_1()
    camera = session.ask_camera_pose(2)
    message.receive_type("get_camera_pose")
    message.close()
    message = server.message_1_1()
    assert answered(message, camera) == POSE
    assert answered(message, session.ask(GetScene()), SCENE).cameras == 3


@pytest.mark.parametrize(
    ("call", "reply", "wanted"),
    [
        (lambda session: session.viewport_size(5), TYPED_SIZE, (8, 6)),
        (lambda session: session.set_viewport(8, 6, 5), TYPED_SIZE, (8, 6)),
        (lambda session: session.camera_pose(0, 5), TYPED_REPLY, POSE),
        (lambda session: session.camera(0, 5).intrinsics, WITH_LENS, LENS_SENT),
        (lambda session: session.scene(5).cameras, SCENE, 3),
        (lambda session: session.ping(5).server_time, {"type": "pong", "serverTime": 1.0}, 1.0),
    ],
)
def test_who_asks_may_wait_for_the_answer(server, session, call, reply, wanted):
    message = server.message_1_1()

    def play():
        request = message.receive()
        message.send({"t": request.get("t")} | reply | {"id": request["id"]})

    player = threading.Thread(target=play)
    player.start()
    assert call(session) == wanted
    player.join()


def test_a_question_may_be_refused(server, session):
    message = server.message_1_1()
    with pytest.raises(ServerRefusedError, match="busy") as caught:
        answered(message, session.ask(SetViewport(9, 6)), BUSY)
    assert caught.value.error.code == "busy"
    assert session.status.no_effect is None, "it was about the size"


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
    assert (session.status.no_effect, session.status.message.problem) == (None, None)
    seen = iter(range(4, 10))
    for told, after, wrong in [
        (("ours-2",), ("ours-3",), {}),
        (("ours-4", "ours-5"), (), {"pointer": "/intrinsics"}),  # of the former's lens
    ]:
        for tag in told:
            session.send_camera(POSE, tag=tag)
            message.receive()
        message.send(BUSY | {"code": "invalid_message"} | wrong)
        answered(message, session.ask_camera_pose(0))
        for tag in after:
            session.send_camera(POSE, tag=tag)
            message.receive()
        for tag in (*told, *after):
            assert session.status.message.problem is not None
            ipc.send(frame(next(seen), camera=CAMERA | {"tag": tag}))
            session.next_frame(5).release()
        assert session.status.message.problem is None
    # Of one that came before the image did, and is read after it.
    message.send(BUSY | {"code": "invalid_message", "pointer": "/intrinsics"})
    answered(message, session.ask_camera_pose(0))
    assert session.status.message.problem is None
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
