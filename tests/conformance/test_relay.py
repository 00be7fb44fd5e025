"""The relay: what it passes on, what it tells, what it does when a peer stalls or dies."""

import socket
import threading
import time
from collections.abc import Iterator

import pytest
from splatbus_conformance.recording import Entry
from splatbus_conformance.relay import RESET, Relay

MOST_SECONDS = 20.0


class Wire:
    """A relay with a server behind it, whose connections the test takes."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.open: list[socket.socket] = []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.settimeout(MOST_SECONDS)
        front = socket.create_server(("127.0.0.1", 0))
        self.port = front.getsockname()[1]
        behind = self.server.getsockname()[:2]
        self.relay = Relay({"msg": front}, {"msg": behind}, self.entries.append)
        self.thread = threading.Thread(target=self.relay.run, daemon=True)
        self.thread.start()

    def connect(self) -> tuple[socket.socket, socket.socket]:
        client = self.knock()
        served, _ = self.server.accept()
        served.settimeout(MOST_SECONDS)
        self.open.append(served)
        return client, served

    def knock(self) -> socket.socket:
        client = socket.create_connection(("127.0.0.1", self.port), timeout=MOST_SECONDS)
        self.open.append(client)
        return client

    def told(self, count: int) -> list[Entry]:
        deadline = time.monotonic() + MOST_SECONDS
        while len(self.entries) < count and time.monotonic() < deadline:
            time.sleep(0.005)
        return list(self.entries)

    def close(self) -> None:
        self.relay.stop()
        self.thread.join(MOST_SECONDS)
        for each in (self.server, *self.open):
            each.close()
        assert not self.thread.is_alive()


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    yield made
    made.close()


def received(peer: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count and (piece := peer.recv(count - len(data))):
        data += piece
    return data


def sent_until_stalled(client: socket.socket, block: bytes) -> int:
    client.settimeout(0.5)
    sent = 0
    while True:
        try:
            sent += client.send(block)
        except TimeoutError:
            return sent


def test_bytes_pass_in_both_directions_and_are_told(wire: Wire) -> None:
    client, served = wire.connect()
    client.sendall(b"question")
    assert received(served, 8) == b"question"
    served.sendall(b"answer")
    assert received(client, 6) == b"answer"
    opened, asked, answered = wire.told(3)
    assert (opened.event, opened.channel, opened.conn) == ("open", "msg", 1)
    assert (asked.dir, asked.data) == ("c2s", b"question")
    assert (answered.dir, answered.data) == ("s2c", b"answer")
    assert 0 <= opened.t <= asked.t <= answered.t


def test_an_end_of_one_direction_leaves_the_other(wire: Wire) -> None:
    client, served = wire.connect()
    client.shutdown(socket.SHUT_WR)
    assert served.recv(1) == b""
    served.sendall(b"still here")
    assert received(client, 10) == b"still here"
    served.close()
    assert client.recv(1) == b""
    assert [(e.dir, e.event or e.data) for e in wire.told(4)] == [
        (None, "open"),
        ("c2s", "eof"),
        ("s2c", b"still here"),
        ("s2c", "eof"),
    ]


def test_a_reset_passes_as_a_reset(wire: Wire) -> None:
    client, served = wire.connect()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    client.close()
    with pytest.raises(ConnectionResetError):
        served.recv(1)
    assert [(e.dir, e.event) for e in wire.told(2)] == [(None, "open"), ("c2s", "reset")]


def test_a_peer_that_stalls_is_felt_and_loses_nothing(wire: Wire) -> None:
    client, served = wire.connect()
    block = bytes(1 << 18)
    sent = sent_until_stalled(client, block)
    passed = sum(len(entry.data or b"") for entry in wire.entries)
    assert passed < sent  # the rest waits at the client: nothing is heaped up in between
    other, beside = wire.connect()
    other.sendall(b"not held up")
    assert received(beside, 11) == b"not held up"
    assert len(received(served, sent)) == sent


def test_without_a_server_a_client_is_let_down_and_nothing_is_told(wire: Wire) -> None:
    wire.server.close()
    with pytest.raises(ConnectionResetError):  # some systems are that quick
        wire.knock().recv(1)
    assert wire.entries == []


def test_connections_are_numbered_and_kept_apart(wire: Wire) -> None:
    pairs = [wire.connect() for _ in range(3)]
    for number, (client, served) in enumerate(pairs, 1):
        client.sendall(bytes([number]))
        assert received(served, 1) == bytes([number])
    sent = {entry.conn: entry.data for entry in wire.told(6) if entry.data}
    assert sent == {1: b"\x01", 2: b"\x02", 3: b"\x03"}
