"""Lenses, objects, time, scenes, sizes, clocks and figures, over real sockets."""

import threading
import time

import pytest
from splatbus_client import (
    Intrinsics,
    NotOfferedError,
    Pose,
    ServerRefusedError,
    connect,
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

POSE = Pose(POSITION, ROTATION)
LENS_SENT = Intrinsics(**LENS)
BUSY = {"type": "error", "code": "busy", "message": "another client steers"}
OTHER = Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))


def test_all_capabilities_are_declared(server, session):
    assert tuple(server.message_1_1().hello["capabilities"]) == MESSAGE_CAPABILITIES
    with_answer(server, session.ask_camera_pose(0), {"type": "camera"} | CAMERA_REPLY)
    assert session.status.message.capabilities == set(MESSAGE_CAPABILITIES)


def settled(session):
    """Wait until the session knows what its server speaks."""
    deadline = time.monotonic() + 5
    while session.status.message.version is None and time.monotonic() < deadline:
        time.sleep(0.005)


def with_answer(server, future, reply):
    """What comes of a question that the newest message connection answers so."""
    message = server._peers[-1]
    message.send(reply | {"id": message.receive()["id"]})
    return future.result(5)


def test_a_lens_a_tag_an_object_and_a_time_are_sent(server, session):
    message = server.message_1_1()
    session.send_camera(POSE, tag="a-1", intrinsics=LENS_SENT)
    camera = message.receive()
    assert (camera["tag"], camera["intrinsics"]) == ("a-1", LENS)
    session.send_object(POSE, "chair", 0.5)
    chair = message.receive()
    assert (chair["type"], chair["object"], chair["scale"]) == ("object_pose", "chair", 0.5)
    session.send_time(1.25)
    assert message.receive() == {"type": "set_time", "time": 1.25}
    assert session.status.no_effect is None


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
    sent = [message.receive() for _ in range(5)]
    assert [m["type"] for m in sent] == [
        "object_pose",
        "object_pose",
        "set_time",
        "camera_pose",
        "subscribe_telemetry",
    ]
    table, chair, time, camera, figures = sent
    assert (table["object"], chair["object"], chair["scale"]) == ("table", "chair", 0.5)
    assert time["time"] == 2.0
    assert camera["intrinsics"] == LENS, "they were in force, though another pose brought them"
    assert "tag" not in camera
    assert camera["position"]["y"] == -2.0
    assert figures["names"] == ["loss"]


def test_a_tag_that_waited_for_its_first_connection_is_sent_on_it(server):
    server.stop()
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        session.send_camera(POSE, tag="a-1")
        server.start()
        message = server.message_1_1()
        assert message.receive()["tag"] == "a-1"
        message.close()
        assert "tag" not in server.message_1_1().receive()


def test_what_the_server_does_not_offer_is_not_sent_and_said_once(server, session, caplog):
    message = server.message_1_1(capabilities=())
    for _ in range(3):
        session.send_object(POSE, "chair")
        session.send_time(1.0)
    session.send_object(POSE)
    assert message.receive()["type"] == "point_cloud_pose"
    assert "'objects', 'time'" not in (session.status.message.problem or "")
    assert session.status.no_effect == "the server does not offer 'objects', 'time' [NEG-5]"
    assert caplog.text.count("does not offer 'objects'") == 1


def test_what_was_sent_too_early_is_said_too_once_the_server_is_known(server, session, caplog):
    session.send_object(POSE, "chair")
    assert session.status.no_effect is None
    message = server.message_1_1(capabilities=())
    session.send_camera(POSE)
    message.receive_type("camera_pose")
    assert "'objects'" in session.status.no_effect
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
    if not early:
        settled(session)
    with pytest.raises(NotOfferedError, match="NEG-5"):
        call(session)
    player.join()


def test_a_server_of_1_0_offers_nothing(server, session):
    message = server.message()
    message.receive_type("get_viewport_size")
    message.send({"viewport_size": [WIDTH, HEIGHT]})
    with pytest.raises(NotOfferedError, match="'scene'"):
        session.scene(5)
    session.send_camera(POSE, tag="a-1", intrinsics=LENS_SENT)
    assert set(message.receive()) == {"type", "timestamp", "position", "rotation"}
    session.send_object(POSE, "chair")
    session.send_object(POSE)
    assert message.receive()["type"] == "point_cloud_pose"


def test_a_scene_is_told(server, session):
    message = server.message_1_1()
    player = threading.Thread(
        target=lambda: message.send(SCENE | {"id": message.receive_type("get_scene")["id"]})
    )
    player.start()
    scene = session.scene(5)
    player.join()
    assert scene.objects[0].bounds.max == (4.0, 1.0, 4.0)
    assert scene.objects[1].bounds is None
    assert scene.cameras == 3


def test_a_size_is_asked_for_and_may_be_refused(server, session):
    message = server.message_1_1()
    answers = session.ask(SetViewport(8, 6)), session.ask(SetViewport(9, 6))
    request = message.receive()
    assert (request["width"], request["height"]) == (8, 6)
    message.send({"type": "viewport_size", "id": request["id"], "viewport_size": [8, 6]})
    assert answers[0].result(5)[:2] == (8, 6)
    message.send(BUSY | {"id": message.receive()["id"]})
    with pytest.raises(ServerRefusedError, match="busy") as caught:
        answers[1].result(5)
    assert caught.value.error.code == "busy"
    assert session.status.no_effect is None, "it was about the size"
    with pytest.raises(ProtocolError, match="VPT-1"):
        session.set_viewport(0, 6, 5)


def test_a_camera_is_told_with_its_lens(server, session):
    message = server.message_1_1()
    reply = {"type": "camera", "intrinsics": LENS} | CAMERA_REPLY
    player = threading.Thread(
        target=lambda: message.send(reply | {"id": message.receive_type("get_camera_pose")["id"]})
    )
    player.start()
    camera = session.camera(0, 5)
    player.join()
    assert (camera.pose, camera.intrinsics) == (POSE, LENS_SENT)


def test_a_ping_tells_the_server_s_clock(server, session):
    message = server.message_1_1()

    def play():
        ping = message.receive_type("ping")
        message.send(
            {"type": "pong", "id": ping["id"], "t": ping["t"], "serverTime": ping["t"] + 1000}
        )

    player = threading.Thread(target=play)
    player.start()
    sample = session.ping(5)
    player.join()
    assert sample.round_trip > 0
    assert abs(sample.ahead - 1000) <= sample.error + 1e-9


def test_busy_is_told_until_an_image_with_a_tag_of_ours_comes(server, session, memory):
    ipc, message = server.ipc_opened(memory), server.message_1_1()
    session.send_camera(POSE, tag="ours-1")
    message.receive()
    message.send(BUSY)
    for seq, tag in [(1, "theirs-7"), (2, None), (3, "ours-1")]:
        camera = CAMERA if tag is None else CAMERA | {"tag": tag}
        with_answer(server, session.ask_camera_pose(0), {"type": "camera"} | CAMERA_REPLY)
        assert "another client has control" in session.status.no_effect
        ipc.send(frame(seq, camera=camera))
        with session.next_frame(5) as lease:
            assert lease.camera.tag == tag
    assert session.status.no_effect is None


def test_busy_ends_with_its_connection(server, session):
    message = server.message_1_1()
    session.send_camera(POSE)
    message.receive()
    message.send(BUSY)
    with_answer(server, session.ask_camera_pose(0), {"type": "camera"} | CAMERA_REPLY)
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
    with_answer(server, session.ask_camera_pose(0), {"type": "camera"} | CAMERA_REPLY)
    assert [session.next_telemetry(5).seq for _ in range(256)] == list(range(44, 300))


def test_waiting_for_telemetry_without_a_server_says_how_to_start_one(server, session):
    server.stop()
    with pytest.raises(TimeoutError, match="splatbus-server"):
        session.next_telemetry(0.3)
