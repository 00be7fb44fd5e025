"""The raw peer: how its connections end."""

import contextlib
import socket
import sys
from collections.abc import Iterator

import pytest
from splatbus_conformance.peer import Connection, Peer

SECONDS = 10.0


@pytest.fixture
def pair() -> Iterator[tuple[Peer, Connection, socket.socket]]:
    """A peer, a connection with a testee, and the testee's end of it."""
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.listen("ipc")
    with socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS) as testee:
        [connection] = peer.until(lambda: peer.connections, SECONDS)
        yield peer, connection, testee
    peer.close()


def test_a_close_ends_the_stream_whatever_is_unread(pair) -> None:
    _, connection, testee = pair
    testee.sendall(bytes(200_000))
    connection.send(b"the last")
    connection.close()
    assert testee.recv(100) == b"the last"
    assert testee.recv(100) == b""
    assert not connection.open


def test_a_reset_is_one(pair) -> None:
    _, connection, testee = pair
    connection.reset()
    with pytest.raises(ConnectionResetError):
        testee.recv(100)


def test_what_is_held_is_connected_and_accepted_later() -> None:
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.hold("ipc")
    with socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS) as testee:
        testee.sendall(b"before it is accepted")
        peer.pump(0.05)
        assert not peer.connections
        peer.listen("ipc")
        assert peer.until(lambda: peer.connections, SECONDS)
        peer.hold("ipc")
        peer.refuse("ipc")
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS)
    peer.close()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere buffers are of other sizes")
def test_little_is_under_way_on_a_narrow_connection() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        peer = Peer("127.0.0.1", dict.fromkeys(("ipc", "msg"), listener.getsockname()[1]))
        peer.narrow = True
        peer.dial("msg").stop_reading()
        testee, _ = listener.accept()
        testee.settimeout(0.5)
        taken = 0
        with testee, contextlib.suppress(TimeoutError):
            while taken < 1 << 20:
                taken += testee.send(bytes(30))
        assert 0 < taken < 1 << 20
        peer.close()
