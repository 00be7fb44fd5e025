"""The relay: what it passes on, what it tells, what it does when a peer stalls or dies."""

import base64
import itertools
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from splatbus_conformance.observe import relay
from splatbus_conformance.observe.relay import RESET, Relay
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.sockets import CHANNELS

MOST_SECONDS = 20.0


class Wire:
    """A relay with a server behind it, whose connections the test takes."""

    def __init__(self, *, threaded: bool = True) -> None:
        self.entries: list[Entry] = []
        self.missed: list[tuple[Channel, str]] = []
        self.open: list[socket.socket] = []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.settimeout(MOST_SECONDS)
        front = socket.create_server(("127.0.0.1", 0))
        self.port = front.getsockname()[1]
        behind = self.server.getsockname()[:2]

        def missed(channel: Channel, reason: str) -> None:
            self.missed.append((channel, reason))

        self.relay = Relay({"msg": front}, {"msg": behind}, self.entries.append, missed)
        self.thread = threading.Thread(target=self.relay.run, daemon=True)
        self.threaded = threaded
        if threaded:
            self.thread.start()

    def connect(self) -> tuple[socket.socket, socket.socket]:
        client = self.knock()
        if not self.threaded:
            self.relay.turn(MOST_SECONDS)
        served, _ = self.server.accept()
        if not self.threaded:
            self.relay.turn(MOST_SECONDS)
        served.settimeout(MOST_SECONDS)
        self.open.append(served)
        return client, served

    def knock(self) -> socket.socket:
        client = socket.create_connection(("127.0.0.1", self.port), timeout=MOST_SECONDS)
        self.open.append(client)
        return client

    def told(
        self, count: int, until: Callable[[list[Entry]], bool] = lambda told: False
    ) -> list[Entry]:
        deadline = time.monotonic() + MOST_SECONDS
        while len(self.entries) < count and not until(self.entries):
            if time.monotonic() > deadline:
                break
            time.sleep(0.005)
        return list(self.entries)

    def close(self) -> None:
        self.relay.stop()
        if not self.threaded:
            self.thread.start()
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


@pytest.mark.parametrize("upstream", [True, False], ids=["to the server", "to the client"])
def test_one_that_reads_slowly_gets_all_of_it(wire: Wire, upstream: bool) -> None:
    client, served = wire.connect()
    source, sink = (client, served) if upstream else (served, client)
    said = random.Random(7).randbytes(3 << 20)

    def say() -> None:
        source.sendall(said)
        source.close()

    sender = threading.Thread(target=say)
    sender.start()
    heard = b""
    while piece := sink.recv(100_003):
        heard += piece
        time.sleep(0.001)
    sender.join(MOST_SECONDS)
    assert heard == said


def test_without_a_server_a_client_is_let_down_and_it_is_said_why(wire: Wire) -> None:
    wire.server.close()
    with pytest.raises(ConnectionResetError):  # some systems are that quick
        wire.knock().recv(1)
    assert wire.entries == []
    [(channel, reason)] = wire.missed
    assert channel == "msg"
    assert "refused" in reason.lower()


def test_every_address_of_a_name_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """`localhost` is ::1 first, and most servers listen on 127.0.0.1."""
    with socket.create_server(("127.0.0.1", 0)) as gone:
        empty = gone.getsockname()
    places = [(socket.AF_INET, empty)]
    monkeypatch.setattr(
        relay, "addresses", lambda host, port: [*places, (socket.AF_INET, (host, port))]
    )
    made = Wire()
    client, served = made.connect()
    client.sendall(b"found")
    assert received(served, 5) == b"found"
    assert made.missed == []
    made.close()


def test_what_it_holds_and_records_is_what_was_said_however_it_was_cut(wire: Wire) -> None:
    """Packets with handles of CUDA memory among them: they are bytes like any other."""
    rng = random.Random(3)
    handles = [packet(encode({"mem_color": base64.b64encode(rng.randbytes(64)).decode()}))]
    said = b"".join([*handles, *(packet(rng.randbytes(rng.randrange(1, 3000))) for _ in range(60))])
    pairs = [wire.connect() for _ in range(2)]
    threads = [
        threading.Thread(target=send_in_pieces, args=(each, said, seed))
        for seed, each in enumerate(end for pair in pairs for end in pair)
    ]
    for thread in threads:
        thread.start()
    heard = [received(end, len(said)) for pair in pairs for end in pair]
    for thread in threads:
        thread.join(MOST_SECONDS)
    for each in (end for pair in pairs for end in pair):
        each.close()
    assert heard == [said] * 4
    wire.told(10_000, until=lambda told: sum(e.event == "eof" for e in told) == 4)
    for number, direction in itertools.product((1, 2), ("c2s", "s2c")):
        recorded = [e.data for e in wire.entries if (e.conn, e.dir) == (number, direction)]
        assert b"".join(data for data in recorded if data) == said


def send_in_pieces(end: socket.socket, said: bytes, seed: int) -> None:
    rng = random.Random(seed)
    while said:
        cut = rng.choice((1, 3, 4, 5, 700, 5000))
        end.sendall(said[:cut])
        said = said[cut:]


@pytest.mark.parametrize("by_client", [True, False], ids=["client", "server"])
def test_the_last_words_before_a_reset_arrive(by_client: bool) -> None:
    """As they do without a relay, also if it first learns of the reset when it sends."""
    made = Wire(threaded=False)
    client, served = made.connect()
    resetting, other = (client, served) if by_client else (served, client)
    other.sendall(b"in the way")
    resetting.sendall(b"last words")
    resetting.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    resetting.close()
    for _ in range(4):
        made.relay.turn(0.05)
    assert received(other, 10) == b"last words"
    with pytest.raises(ConnectionResetError):
        other.recv(1)
    direction = "c2s" if by_client else "s2c"
    assert [(e.data, e.event) for e in made.entries if e.dir == direction] == [
        (b"last words", None),
        (None, "reset"),
    ]
    made.close()


def test_channels_come_and_go_by_themselves() -> None:
    entries: list[Entry] = []
    listeners: dict[Channel, socket.socket] = {c: listening() for c in CHANNELS}
    servers = {c: listening() for c in CHANNELS}
    ports = {c: each.getsockname()[1] for c, each in listeners.items()}
    behind = {c: each.getsockname()[:2] for c, each in servers.items()}
    running = Relay(listeners, behind, entries.append)
    thread = threading.Thread(target=running.run, daemon=True)
    thread.start()

    def connect(channel: Channel) -> tuple[socket.socket, socket.socket]:
        client = socket.create_connection(("127.0.0.1", ports[channel]), timeout=MOST_SECONDS)
        served, _ = servers[channel].accept()
        served.settimeout(MOST_SECONDS)
        return client, served

    steady = connect("msg")
    for turn in range(3):
        client, served = connect("ipc")
        served.sendall(b"init")
        assert received(client, 4) == b"init"
        client.close()
        assert served.recv(1) == b""
        served.close()
        steady[0].sendall(bytes([turn]))
        assert received(steady[1], 1) == bytes([turn])
    running.stop()
    thread.join(MOST_SECONDS)
    for each in (*steady, *servers.values()):
        each.close()
    opened = [(e.channel, e.conn) for e in entries if e.event == "open"]
    assert opened == [("msg", 1), ("ipc", 1), ("ipc", 2), ("ipc", 3)]


def listening() -> socket.socket:
    made = socket.create_server(("127.0.0.1", 0))
    made.settimeout(MOST_SECONDS)
    return made


def test_connections_are_numbered_and_kept_apart(wire: Wire) -> None:
    pairs = [wire.connect() for _ in range(3)]
    for number, (client, served) in enumerate(pairs, 1):
        client.sendall(bytes([number]))
        assert received(served, 1) == bytes([number])
    sent = {entry.conn: entry.data for entry in wire.told(6) if entry.data}
    assert sent == {1: b"\x01", 2: b"\x02", 3: b"\x03"}
