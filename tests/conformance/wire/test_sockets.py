"""The raw peer: how its connections end, and whose time it counts."""

import contextlib
import socket
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest
from splatbus_conformance.wire import sockets
from splatbus_conformance.wire.sockets import GRACE_SECONDS, RESET_ON_CLOSE, TICK_SECONDS, Peer

SECONDS = 10.0


@pytest.fixture
def peer() -> Iterator[Peer]:
    """One that listens on the IPC channel."""
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    peer.listen("ipc")
    yield peer
    peer.close()


def dialled(peer: Peer) -> socket.socket:
    """A testee's end of a new connection."""
    return socket.create_connection(("127.0.0.1", peer.ports["ipc"]), SECONDS)


def test_who_hears_one_connection_knows_how_another_ended_before(peer: Peer) -> None:
    with dialled(peer) as testee, dialled(peer) as other:
        peer.until(lambda: len(peer.connections) == 2, SECONDS)
        first, second = peer.connections
        testee.sendall(b"\1\0\0\0." * 100)
        testee.close()
        other.sendall(b"\1\0\0\0.")
        assert peer.until(lambda: second.messages, SECONDS)
        assert first.ended == "eof"
        assert len(first.messages) == 100


@pytest.mark.parametrize("how", ["close", "reset"])
def test_a_close_ends_the_stream_whatever_is_unread_and_a_reset_is_one(
    peer: Peer, how: str
) -> None:
    with dialled(peer) as testee:
        [connection] = peer.until(lambda: peer.connections, SECONDS)
        testee.sendall(bytes(200_000))
        connection.send(b"the last")
        getattr(connection, how)()
        assert not connection.open
        if how == "close":
            assert testee.recv(100) == b"the last"
            assert testee.recv(100) == b""
        else:
            with pytest.raises(ConnectionResetError):
                testee.recv(100), testee.recv(100)


def test_what_is_held_is_connected_and_accepted_later(peer: Peer) -> None:
    peer.hold("ipc")
    with dialled(peer):
        peer.pump(0.05)
        assert not peer.connections
        peer.listen("ipc")
        assert peer.until(lambda: peer.connections, SECONDS)
        peer.refuse("ipc")
        with pytest.raises(ConnectionRefusedError):
            dialled(peer)


@pytest.mark.parametrize("kept_waiting", [True, False])
def test_whom_the_harness_has_kept_waiting_is_not_judged(
    kept_waiting: bool, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "AWAY_SECONDS", -1.0 if kept_waiting else 1e9)
    with dialled(peer) as testee:
        peer.clear()
        assert (peer.connections, peer.entries) == ([], [])
        assert bool(peer.last_opened["ipc"]) is kept_waiting
        came = peer.until(lambda: peer.connections, 0.0 if kept_waiting else SECONDS)
        assert bool(came) is not kept_waiting
        assert not kept_waiting or testee.recv(1) == b""


def test_who_resets_before_it_is_accepted_has_connected_and_ended(peer: Peer) -> None:
    with dialled(peer) as testee:
        testee.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
    [connection] = peer.until(lambda: peer.connections, SECONDS)
    assert peer.until(lambda: connection.ended, SECONDS) == "reset"


# Whose time is counted


def test_what_is_sent_is_on_record_as_of_before_it_could_be_answered(
    peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with dialled(peer):
        [connection] = peer.until(lambda: peer.connections, SECONDS)
        noted = list[float]()
        taking = SimpleNamespace(sendall=lambda _: noted.append(peer.now()))
        monkeypatch.setattr(connection, "_sock", taking)
        connection.send(b"x")
        monkeypatch.undo()
    assert peer.entries[-1].t <= noted[0]


@pytest.fixture
def clocked(monkeypatch: pytest.MonkeyPatch) -> Callable[..., SimpleNamespace]:
    """A clock, and a peer by it, each look of which takes as long as it is told."""

    def clocked(takes: Callable[[SimpleNamespace, float], float]) -> SimpleNamespace:
        clock = SimpleNamespace(now=0.0, looks=0)

        def select(seconds: float) -> list[object]:
            clock.looks += 1
            clock.now += takes(clock, seconds)
            return []

        monkeypatch.setattr(sockets, "time", SimpleNamespace(monotonic=lambda: clock.now))
        clock.peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
        monkeypatch.setattr(clock.peer, "_selector", SimpleNamespace(select=select))
        return clock

    return clocked


@pytest.mark.parametrize("where", ["it waits", "it thinks"])
def test_patience_is_not_spent_while_the_harness_cannot_look(where: str, clocked) -> None:
    clock = clocked(lambda it, took: took + 60.0 * (where == "it waits" and it.looks == 3))

    def never() -> bool:
        clock.now += 60.0 * (where == "it thinks" and clock.looks == 3)
        return False

    began = clock.peer.clock()
    assert clock.peer.until(never, 50 * TICK_SECONDS) is False
    assert 50 - GRACE_SECONDS / TICK_SECONDS - 2 <= clock.looks <= 51
    passed = clock.peer.clock() - began
    assert passed == pytest.approx(50 * TICK_SECONDS, abs=2 * TICK_SECONDS)


@pytest.mark.parametrize(("share", "away"), [(0.75, 0.0), (1.0, 60.0)])
def test_patience_is_not_spent_while_the_testee_cannot_run(
    share: float, away: float, clocked
) -> None:
    """Nor twice, where the harness could not look meanwhile."""
    delayed, looked = [0.0], list[float]()

    def takes(clock: SimpleNamespace, seconds: float) -> float:
        took = max(seconds, 1e-3) + away
        delayed[0] += share * took * (clock.now + took < 500.0)
        return took

    clock = clocked(takes)
    clock.peer.delays = lambda: {1: delayed[0] / 3, 2: delayed[0]}
    clock.peer.until(lambda: looked.append(clock.peer.clock()), 10.0)
    assert looked == sorted(looked)
    assert clock.now >= (500.0 if away else 10.0 / (1 - share)) - 1.0
    assert clock.peer.kept_seconds() >= (450.0 if away else 29.0)
    clock.peer.clear()
    assert clock.peer.kept_seconds() == 0


def test_patience_is_spent_on_a_testee_that_does_not_accept(
    clocked, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = clocked(lambda *_: 0.0)

    def create_connection(address: object, seconds: float) -> None:
        clock.now += seconds
        raise TimeoutError

    def refused() -> None:
        with contextlib.suppress(OSError):
            clock.peer.dial("msg", 5.0)

    monkeypatch.setattr(sockets.socket, "create_connection", create_connection)
    clock.peer.until(refused, 12.0)
    assert clock.now == 15.0
