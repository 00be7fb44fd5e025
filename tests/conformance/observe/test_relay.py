"""The relay: what it passes on, what it tells, what it does when a peer stalls or dies."""

import random
import socket
import threading
from collections.abc import Iterator

import pytest
from splatbus_conformance.observe import relay
from splatbus_conformance.observe.relay import Relay
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.sockets import CHANNELS, RESET_ON_CLOSE

from tests.waiting import eventually

MOST_SECONDS = 20.0


def listening() -> socket.socket:
    made = socket.create_server(("127.0.0.1", 0))
    made.settimeout(MOST_SECONDS)
    return made


class Wire:
    """A relay with a server behind it, whose connections the test takes."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.missed: list[tuple[Channel, str]] = []
        self.open: list[socket.socket] = []
        self.servers = {channel: listening() for channel in CHANNELS}
        self.fronts: dict[Channel, socket.socket] = {it: listening() for it in CHANNELS}
        self.ports = {channel: it.getsockname()[1] for channel, it in self.fronts.items()}
        behind = {channel: it.getsockname()[:2] for channel, it in self.servers.items()}
        self.relay = Relay(
            self.fronts, behind, self.entries.append, lambda *told: self.missed.append(told)
        )
        self.thread = threading.Thread(target=self.relay.run, daemon=True)

    def knock(self, channel: Channel = "msg") -> socket.socket:
        client = socket.create_connection(("127.0.0.1", self.ports[channel]), MOST_SECONDS)
        self.open.append(client)
        return client

    def connect(self, channel: Channel = "msg") -> tuple[socket.socket, socket.socket]:
        """A client's end and the server's; where the relay has no thread, it is given a turn."""
        client = self.knock(channel)
        if not self.thread.is_alive():
            self.relay.turn(MOST_SECONDS)
        served, _ = self.servers[channel].accept()
        if not self.thread.is_alive():
            self.relay.turn(MOST_SECONDS)
        served.settimeout(MOST_SECONDS)
        self.open.append(served)
        return client, served

    def told(self, direction: str | None = None) -> list[tuple[str, int, object]]:
        """What was told of a direction, or of all but bytes."""
        return [
            (it.channel, it.conn, it.event or it.data)
            for it in self.entries
            if (it.dir == direction if direction else it.event)
        ]

    def close(self) -> None:
        self.relay.stop()
        if not self.thread.is_alive():
            self.thread.start()
        self.thread.join(MOST_SECONDS)
        for each in (*self.servers.values(), *self.open):
            each.close()
        assert not self.thread.is_alive()


@pytest.fixture
def still() -> Iterator[Wire]:
    """One whose relay has no thread."""
    made = Wire()
    yield made
    made.close()


@pytest.fixture
def wire(still: Wire) -> Wire:
    still.thread.start()
    return still


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


def test_an_end_of_one_direction_leaves_the_other(wire: Wire) -> None:
    client, served = wire.connect()
    client.shutdown(socket.SHUT_WR)
    assert served.recv(1) == b""
    served.sendall(b"still here")
    assert received(client, 10) == b"still here"
    served.close()
    assert client.recv(1) == b""
    assert eventually(lambda: len(wire.entries) == 4)
    assert [(it.dir, it.event or it.data) for it in wire.entries] == [
        (None, "open"),
        ("c2s", "eof"),
        ("s2c", b"still here"),
        ("s2c", "eof"),
    ]
    times = [it.t for it in wire.entries]
    assert times == sorted(times)
    assert times[0] >= 0


def test_a_peer_that_stalls_is_felt_and_loses_nothing(wire: Wire) -> None:
    client, served = wire.connect()
    sent = sent_until_stalled(client, bytes(1 << 18))
    passed = sum(len(entry.data or b"") for entry in wire.entries)
    assert passed < sent  # the rest waits at the client: nothing is heaped up in between
    other, beside = wire.connect()
    other.sendall(b"not held up")
    assert received(beside, 11) == b"not held up"
    assert len(received(served, sent)) == sent


def test_without_a_server_a_client_is_let_down_and_it_is_said_why(wire: Wire) -> None:
    wire.servers["msg"].close()
    with pytest.raises(ConnectionResetError):  # some systems are that quick
        wire.knock().recv(1)
    assert wire.entries == []
    [(channel, reason)] = wire.missed
    assert (channel, reason) == ("msg", "Connection refused")


def test_every_address_of_a_name_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """`localhost` is ::1 first, and most servers listen on 127.0.0.1."""
    with socket.create_server(("127.0.0.1", 0)) as gone:
        places = [(socket.AF_INET, gone.getsockname())]
    monkeypatch.setattr(
        relay, "addresses", lambda host, port: [*places, (socket.AF_INET, (host, port))]
    )
    made = Wire()
    made.thread.start()
    client, served = made.connect()
    client.sendall(b"found")
    assert received(served, 5) == b"found"
    assert made.missed == []
    made.close()


def test_what_it_holds_and_records_is_what_was_said_however_it_was_cut(wire: Wire) -> None:
    rng = random.Random(3)
    said = b"".join(packet(rng.randbytes(rng.randrange(1, 3000))) for _ in range(60))
    ends = [end for _ in range(2) for end in wire.connect()]

    def say(end: socket.socket) -> None:
        rng, left = random.Random(id(end)), said
        while left:
            cut = rng.choice((1, 3, 4, 5, 700, 5000))
            end.sendall(left[:cut])
            left = left[cut:]

    threads = [threading.Thread(target=say, args=[end]) for end in ends]
    for thread in threads:
        thread.start()
    assert [received(end, len(said)) for end in ends] == [said] * 4
    for thread in threads:
        thread.join(MOST_SECONDS)
    for end in ends:
        end.close()
    assert eventually(lambda: sum(it.event == "eof" for it in wire.entries) == 4)
    for direction in ("c2s", "s2c"):
        told = wire.told(direction)
        for number in (1, 2):
            pieces = [it for _, conn, it in told if conn == number and isinstance(it, bytes)]
            assert b"".join(pieces) == said


@pytest.mark.parametrize("by_client", [True, False], ids=["client", "server"])
def test_the_last_words_before_a_reset_arrive(still: Wire, by_client: bool) -> None:
    """As they do without a relay, also if it first learns of the reset when it sends."""
    resetting, other = still.connect()[:: 1 if by_client else -1]
    other.sendall(b"in the way")
    resetting.sendall(b"last words")
    resetting.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
    resetting.close()
    for _ in range(4):
        still.relay.turn(0.05)
    assert received(other, 10) == b"last words"
    with pytest.raises(ConnectionResetError):
        other.recv(1)
    told = still.told("c2s" if by_client else "s2c")
    assert told == [("msg", 1, b"last words"), ("msg", 1, "reset")]


def test_channels_come_and_go_by_themselves(wire: Wire) -> None:
    steady = wire.connect("msg")
    for turn in range(3):
        client, served = wire.connect("ipc")
        served.sendall(b"init")
        assert received(client, 4) == b"init"
        client.close()
        assert served.recv(1) == b""
        served.close()
        steady[0].sendall(bytes([turn]))
        assert received(steady[1], 1) == bytes([turn])
    opened = [("msg", 1, "open"), *(("ipc", number, "open") for number in (1, 2, 3))]
    assert eventually(lambda: [it for it in wire.told() if it[2] == "open"] == opened)
