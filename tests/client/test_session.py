"""A session's connections, over real sockets, to a server that the test plays."""

import logging
import threading

import pytest
from splatbus_client import connect

from tests.peers.fake_server import POSE, frame


def test_a_client_that_is_early_finds_its_server(server, memory):
    server.stop()
    with connect("127.0.0.1", server.ipc_port, server.message_port) as session:
        with pytest.raises(TimeoutError, match="splatbus-server"):
            session.next_frame(0.2)
        with pytest.raises(TimeoutError, match="splatbus-server"):
            session.viewport_size(0.2)
        server.start()
        server.ipc_opened(memory).send(frame(1))
        with session.next_frame(5):
            pass


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
