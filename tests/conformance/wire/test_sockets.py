"""The raw peer: how its connections end."""

import contextlib
import socket
import sys
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from splatbus_conformance.wire.sockets import (
    GRACE_SECONDS,
    RESET_ON_CLOSE,
    TICK_SECONDS,
    Connection,
    Peer,
)

SECONDS = 10.0
SOCKETS = "splatbus_conformance.wire.sockets"


@pytest.fixture
def pair() -> Iterator[tuple[Peer, Connection, socket.socket]]:
    """A peer, a connection with a testee, and the testee's end of it."""
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.listen("ipc")
    with socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS) as testee:
        [connection] = peer.until(lambda: peer.connections, SECONDS)
        yield peer, connection, testee
    peer.close()


def test_who_hears_one_connection_knows_how_another_ended_before(pair) -> None:
    peer, first, testee = pair
    with socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS) as other:
        peer.until(lambda: len(peer.connections) == 2, SECONDS)
        second = peer.connections[1]
        testee.sendall(b"\1\0\0\0." * 100)
        testee.close()
        other.sendall(b"\1\0\0\0.")
        assert peer.until(lambda: second.messages, SECONDS)
        assert first.ended == "eof"
        assert len(first.messages) == 100


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


@pytest.mark.parametrize("kept_waiting", [True, False])
def test_whom_the_harness_has_kept_waiting_is_not_judged(kept_waiting, monkeypatch) -> None:
    monkeypatch.setattr(f"{SOCKETS}.AWAY_SECONDS", -1.0 if kept_waiting else 1e9)
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.listen("ipc")
    with socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS) as testee:
        peer.clear()
        assert not peer.connections
        assert not peer.entries
        assert peer.last_opened["ipc"] > 0 or not kept_waiting
        came = peer.until(lambda: peer.connections, 0.0 if kept_waiting else SECONDS)
        assert bool(came) is not kept_waiting
        if kept_waiting:
            testee.settimeout(SECONDS)
            assert testee.recv(1) == b""
    peer.close()


@pytest.mark.parametrize("where", ["it waits", "it thinks"])
def test_patience_is_not_spent_while_the_harness_cannot_look(where, monkeypatch) -> None:
    clock = SimpleNamespace(now=0.0, looks=0)

    def select(seconds: float) -> list[object]:
        clock.looks += 1
        clock.now += seconds + 60.0 * (where == "it waits" and clock.looks == 3)
        return []

    def never() -> bool:
        clock.now += 60.0 * (where == "it thinks" and clock.looks == 3)
        return False

    monkeypatch.setattr(f"{SOCKETS}.time", SimpleNamespace(monotonic=lambda: clock.now))
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    monkeypatch.setattr(peer, "_selector", SimpleNamespace(select=select))
    began = peer.clock()
    assert peer.until(never, 50 * TICK_SECONDS) is False
    assert 50 - GRACE_SECONDS / TICK_SECONDS - 2 <= clock.looks <= 51
    assert peer.clock() - began == pytest.approx(50 * TICK_SECONDS, abs=2 * TICK_SECONDS)


@pytest.mark.parametrize(("share", "away"), [(0.75, 0.0), (1.0, 60.0)])
def test_patience_is_not_spent_while_the_testee_cannot_run(share, away, monkeypatch) -> None:
    """Nor twice, where the harness could not look meanwhile."""
    clock = SimpleNamespace(now=0.0, delayed=0.0)

    def select(seconds: float) -> list[object]:
        clock.now += max(seconds, 1e-3) + away
        clock.delayed += share * (seconds + away) * (clock.now < 500.0)
        return []

    monkeypatch.setattr(f"{SOCKETS}.time", SimpleNamespace(monotonic=lambda: clock.now))
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    monkeypatch.setattr(peer, "_selector", SimpleNamespace(select=select))
    peer.delays = lambda: {1: clock.delayed / 3, 2: clock.delayed}
    looked: list[float] = []
    peer.until(lambda: looked.append(peer.clock()), 10.0)
    assert looked == sorted(looked)
    assert clock.now >= (500.0 if away else 10.0 / (1 - share)) - 1.0


def test_patience_is_spent_on_a_testee_that_does_not_accept(monkeypatch) -> None:
    clock = SimpleNamespace(now=0.0)

    def create_connection(address: object, seconds: float) -> None:
        clock.now += seconds
        raise TimeoutError

    def refused() -> None:
        with contextlib.suppress(OSError):
            peer.dial("msg", 5.0)

    monkeypatch.setattr(f"{SOCKETS}.time", SimpleNamespace(monotonic=lambda: clock.now))
    monkeypatch.setattr(f"{SOCKETS}.socket.create_connection", create_connection)
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    monkeypatch.setattr(peer, "_selector", SimpleNamespace(select=lambda seconds: []))
    peer.until(refused, 12.0)
    assert clock.now == 15.0


def test_who_resets_before_it_is_accepted_has_connected_and_ended() -> None:
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.listen("ipc")
    with socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS) as testee:
        testee.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
    [connection] = peer.until(lambda: peer.connections, SECONDS)
    assert peer.until(lambda: connection.ended, SECONDS) == "reset"
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
