"""A channel's life in virtual time, over real sockets [1.0 chapter 3]."""

import selectors
import socket

import pytest
from splatbus_client import channel as channel_module
from splatbus_client.channel import Channel
from splatbus_client.events import Ignored, Negotiated, Refused, ServerError
from splatbus_schemas import LIMITS
from splatbus_wire.messages import ErrorMessage

from tests.peers.fake_server import SECONDS


class Owner:
    """Makes machines that repeat what the test wants them to say of whatever arrives."""

    def __init__(self, events=()):
        self.events = events
        self.begun = self.ended = 0
        self.handled = []
        self.sending = b""

    def begin(self):
        self.begun += 1
        return self

    def handle(self, event):
        self.handled.append(event)

    def end(self):
        self.ended += 1

    def receive(self, data, now):
        return self.events

    def expire(self, now):
        return []

    def deadline(self):
        return None

    def data_to_send(self, now):
        data, self.sending = self.sending, b""
        return data


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(SECONDS)
        yield listener


@pytest.fixture
def accept(listener):
    """The server's end of the next connection, closed when the test ends."""
    connections = []

    def accept():
        connections.append(listener.accept()[0])
        return connections[-1]

    yield accept
    for connection in connections:
        connection.close()


def channel_to(listener, owner, tap=None):
    return Channel("test", "127.0.0.1", listener.getsockname()[1], owner, tap)


def step(channel, now):
    """Let the channel do, at `now`, what its socket is ready for within a moment."""
    channel.advance(now)
    if channel.socket is not None:
        with selectors.DefaultSelector() as selector:
            selector.register(channel.socket, channel.interest())
            for _, mask in selector.select(SECONDS):
                channel.ready(mask, now)


def test_a_tap_hears_each_connection_and_all_its_bytes(listener, accept):
    owner, heard = Owner(), []
    channel = channel_to(listener, owner, lambda *told: heard.append(told))
    for first, then in ((b"hello", b"welcome"), (b"again", b"once more")):
        owner.sending = first
        while channel.machine is None:
            step(channel, channel.due)
        server = accept()
        server.settimeout(SECONDS)
        assert server.recv(64) == first
        server.sendall(then)
        while heard[-1][1] != "received":
            step(channel, 0.0)
        assert heard == [
            ("test", "connected", b""),
            ("test", "sent", first),
            ("test", "received", then),
        ]
        heard.clear()
        server.close()
        while channel.machine is not None:
            step(channel, 0.0)
    channel.close()


def lose_again_and_again(listener, owner, times, lasting=0.0):
    """Seconds from each loss to the next attempt, where the server ends each connection."""
    channel = channel_to(listener, owner)
    now, waits = 0.0, []
    for _ in range(times):
        step(channel, now)
        connection = listener.accept()[0]
        connection.send(b"x")
        step(channel, now)
        now += lasting
        connection.close()
        while channel.socket is not None:
            step(channel, now)
        waits.append(channel.deadline() - now)
        now = channel.deadline()
    channel.close()
    return waits


UNAUTHORIZED = ErrorMessage("unauthorized", "no")
SETTLED = Negotiated("1.1", None, frozenset())
LONG = LIMITS["reconnect_max_seconds"]


@pytest.mark.parametrize(
    ("events", "lasting", "least", "grows"),
    [
        ([SETTLED], 0.0, 0.0, False),
        ([], LONG, 0.0, False),
        ([], 0.0, 0.0, True),
        ([Ignored("no JSON")], 0.0, 0.0, True),
        ([ServerError(UNAUTHORIZED)], 0.0, LIMITS["error_pause_seconds"], True),
        ([Refused(0, UNAUTHORIZED)], 0.0, LIMITS["error_pause_seconds"], True),
        ([SETTLED, ServerError(ErrorMessage("busy", "no"))], 0.0, 0.0, True),
    ],
)
def test_a_server_that_turns_us_away_is_asked_less_and_less_often(
    listener, events, lasting, least, grows
):
    """Unless something was understood of it, or the connection lasted."""
    owner = Owner(events)
    waits = lose_again_and_again(listener, owner, 4, lasting)
    assert waits == sorted(waits)
    assert min(waits) >= least
    assert len({round(wait, 6) for wait in waits}) == (4 if grows else 1)
    assert (owner.begun, owner.ended) == (4, 4)


def test_an_unknown_host_is_named():
    with pytest.raises(OSError, match=r"no\.such\.host\.invalid"):
        Channel("test", "no.such.host.invalid", 6001, Owner())


def test_an_attempt_that_nobody_answers_is_given_up(listener):
    channel = channel_to(listener, Owner())
    channel.advance(0.0)
    limit = channel.deadline()
    channel.advance(limit)
    assert channel.socket is None
    assert "no answer" in channel.status.problem
    assert channel.deadline() - limit <= LIMITS["reconnect_max_seconds"]


def test_a_socket_that_connected_to_itself_is_no_server(listener, monkeypatch):
    class Itself(socket.socket):
        def getpeername(self):
            return self.getsockname()

    owner = Owner()
    channel = channel_to(listener, owner)
    monkeypatch.setattr(channel_module.socket, "socket", Itself)
    step(channel, 0.0)
    assert owner.begun == 0
    assert "refused" in channel.status.problem


def test_a_name_with_several_addresses_is_tried_at_each(listener, monkeypatch):
    port = listener.getsockname()[1]
    nowhere, here = (
        (socket.AF_INET, socket.SOCK_STREAM, 0, "", (host, port))
        for host in ("127.0.0.2", "127.0.0.1")
    )
    monkeypatch.setattr(channel_module.socket, "getaddrinfo", lambda *_, **__: [nowhere, here])
    owner = Owner()
    channel = channel_to(listener, owner)
    step(channel, 0.0)
    assert owner.begun == 0
    step(channel, channel.deadline())
    assert owner.begun == 1
    channel.close()


def test_what_a_socket_does_not_take_at_once_is_sent_later_but_on_no_other(listener, accept):
    owner = Owner()
    channel = channel_to(listener, owner)
    step(channel, 0.0)
    connection = accept()
    owner.sending = bytes(8_000_000)
    channel.flush(0.0)
    assert channel.interest() & selectors.EVENT_WRITE
    received = 0
    while received < 8_000_000:
        received += len(connection.recv(1 << 20))
        channel.ready(selectors.EVENT_WRITE, 0.0)
    assert channel.interest() == selectors.EVENT_READ
    owner.sending = bytes(8_000_000)
    channel.flush(0.0)
    connection.close()
    while channel.machine is not None:
        step(channel, 0.0)
    owner.sending = b"anew"
    step(channel, channel.due)
    assert accept().recv(64) == b"anew"
    channel.close()


def test_a_host_that_vanished_is_noticed_and_no_small_packet_waits(listener):
    channel = channel_to(listener, Owner())
    step(channel, 0.0)
    assert channel.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    assert channel.socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    if hasattr(socket, "TCP_KEEPIDLE"):
        idle, interval, count = (
            channel.socket.getsockopt(socket.IPPROTO_TCP, getattr(socket, f"TCP_KEEP{name}"))
            for name in ("IDLE", "INTVL", "CNT")
        )
        assert idle + interval * count <= 60
    channel.close()
