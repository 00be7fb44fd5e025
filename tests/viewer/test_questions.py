"""What is asked on each new connection, over real sockets."""

import time

from splatbus_viewer.questions import Questions
from splatbus_wire.poses import IDENTITY

from tests.peers.fake_server import CAMERA_REPLY, HEIGHT, POSITION, WIDTH


def follow(questions, until):
    deadline = time.monotonic() + 5
    while not until() and time.monotonic() < deadline:
        questions.follow()
        time.sleep(0.005)
    return until()


def test_questions_of_connections_that_ended_are_not_kept(server, session):
    questions = Questions(session, (64, 48))
    for connections in range(1, 6):
        message = server.message_1_1()
        assert follow(questions, lambda n=connections: session.status.message.connections == n)
        questions.follow()
        message.receive_type("get_camera_pose")
        message.close()
    assert len(session._steering.questions) <= 3


def test_camera_and_size_are_asked_for_once_connected(server, session):
    questions = Questions(session)
    questions.follow()
    assert (questions.camera, questions.size) == (IDENTITY, (0, 0))
    message = server.message_1_1()
    assert follow(questions, lambda: session.status.message.connections == 1)
    questions.follow()
    request = message.receive_type("get_camera_pose")
    message.send({"type": "camera", **CAMERA_REPLY, "id": request["id"]})
    assert follow(questions, lambda: questions.camera.position == POSITION)
    if questions.size == (0, 0):  # the session's own question was answered before ours came
        request = message.receive_type("get_viewport_size")
        size = {"viewport_size": [WIDTH, HEIGHT], "id": request["id"]}
        message.send({"type": "viewport_size", **size})
    assert follow(questions, lambda: questions.size == (WIDTH, HEIGHT))
