"""What is asked on each new connection, over real sockets."""

import time

from splatbus_viewer.questions import Questions


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
