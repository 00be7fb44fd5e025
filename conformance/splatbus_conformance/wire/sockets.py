"""The raw peer: its connections with a testee, whichever side made them, and a record of it all.

One thread and one selector. Nothing happens but inside `pump` and what calls it, so a check reads
as a sequence of steps. Every wait has a limit.
"""

import contextlib
import selectors
import socket
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Literal, TypeVar

from splatbus_conformance.wire.conversation import Assembler, Conversation, Message
from splatbus_conformance.wire.packets import HEADER, Splitter
from splatbus_conformance.wire.places import addresses
from splatbus_conformance.wire.ports import listen_somewhere
from splatbus_conformance.wire.recording import Channel, Direction, Entry, Event

T = TypeVar("T")
CHANNELS: tuple[Channel, Channel] = ("ipc", "msg")
READ_BYTES = 1 << 16
MOST_LEFT_READS = 64
MOST_ROUNDS = 16
"""A step handles all that has come, so that whoever acts on what one connection said also knows
what the testee did before on another; but a flood never ends.
"""
SEND_SECONDS = 5.0
DIAL_SECONDS = 5.0
NARROW_BYTES, NARROW_SEGMENT = 4096, 536
TICK_SECONDS = 0.02
"""How often a condition is looked at while nothing happens on the wire."""
DELAYS_SECONDS = 0.2
"""As often it is asked whether the testee was kept from running."""
GRACE_SECONDS = 0.1
"""Whoever looks away for longer has no clock of what others do meanwhile."""
AWAY_SECONDS = 1.0
"""Whoever has waited for so long to be accepted may be about to give up."""
RESET_ON_CLOSE = (
    struct.pack("ii", 1, 0) if hasattr(socket, "SO_REUSEPORT") else struct.pack("hh", 1, 0)
)


class Connection:
    """One connection with the testee."""

    def __init__(
        self,
        peer: "Peer",
        sock: socket.socket,
        channel: Channel,
        number: int,
        testee_port: int,
        stream: Splitter,
    ) -> None:
        self.channel = channel
        self.number = number
        self.opened = time.monotonic()
        self.port: int = sock.getsockname()[1]
        """The port at this end."""
        self.testee_port = testee_port
        """The port at the testee's end."""
        self.messages: list[Message] = []
        """What the testee has sent, packet by packet, in the time of the record."""
        self.ended: Literal["eof", "reset"] | None = None
        """How the testee ended its stream, if it did."""
        self.open = True
        """The harness has not closed it."""
        self.gone_since: float | None = None
        """When either of both closed it, by the monotonic clock."""
        self.sent = 0
        """Bytes that the harness has sent."""
        self._peer = peer
        self._sock = sock
        self._stream = stream

    def send(self, data: bytes) -> None:
        """Send bytes as they are, in one write; quietly nothing if the testee has gone."""
        if self.open:
            began = self._peer.now()  # the testee may answer before the harness runs again
            with contextlib.suppress(OSError):
                with self._peer.waiting():
                    self._sock.sendall(data)
                self._peer.note(self, self._peer.ours, data, began)
                self.sent += len(data)

    @property
    def gone(self) -> bool:
        """One of both has closed it."""
        return self.ended is not None or not self.open

    @property
    def no_packet(self) -> bytes:
        """What the testee sent from a header on that is none (FRM-2), as far as it is kept."""
        return self._stream.rest if self._stream.refused is not None else b""

    @property
    def unfinished(self) -> bytes:
        """What has come of a payload that is not complete."""
        return self._stream.rest[HEADER:] if self._stream.refused is None else b""

    def arrived(self, message: Message) -> float:
        """When a message had come, by the monotonic clock."""
        return self._peer.by_clock(message.packet.ended)

    def push(self, data: bytes, *, noted: bool = False) -> int | None:
        """Send what TCP takes at once; how much, or None if the testee has gone.

        It is not noted of floods, which no rule has to read.
        """
        self._sock.setblocking(False)
        try:
            taken = self._sock.send(data)
            if noted:
                self._peer.note(self, self._peer.ours, data[:taken])
            return taken
        except BlockingIOError:
            return 0
        except OSError:
            return None
        finally:
            self._sock.settimeout(SEND_SECONDS)

    def stop_reading(self) -> None:
        """Leave unread whatever comes from now on."""
        self._peer.forget(self._sock)

    def end_stream(self) -> None:
        """Say that nothing more comes, and go on listening (a TCP half-close)."""
        with contextlib.suppress(OSError):
            self._sock.shutdown(socket.SHUT_WR)
        self._peer.note_event(self, "eof", self._peer.ours)

    def close(self) -> None:
        """Close, so that the testee sees the stream end: what is unread would make it a reset."""
        if self.open:
            self._is_gone()
            self.open = False
            self._peer.forget(self._sock)
            self._leave_nothing_unread()
            self._sock.close()
            self._peer.note_event(self, "eof", self._peer.ours)

    def reset(self) -> None:
        """Close so that the testee sees a reset."""
        if self.open:
            self._sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
            self._is_gone()
            self.open = False
            self._peer.forget(self._sock)
            self._sock.close()
            self._peer.note_event(self, "reset", self._peer.ours)

    def _is_gone(self) -> None:
        if self.gone_since is None:
            self.gone_since = time.monotonic()

    def _leave_nothing_unread(self) -> None:
        with contextlib.suppress(OSError):
            self._sock.setblocking(False)
            for _ in range(MOST_LEFT_READS):  # a flood would never end
                if not self._sock.recv(READ_BYTES):
                    break

    def read(self) -> list[Message]:
        """Take what has arrived; return the messages that it completes."""
        try:
            data = self._sock.recv(READ_BYTES)
        except (TimeoutError, BlockingIOError):
            return []
        except OSError:
            self._is_gone()
            self.ended = "reset"
            self._peer.note_event(self, "reset", self._peer.theirs)
            return []
        if not data:
            self._is_gone()
            self.ended = "eof"
            self._peer.note_event(self, "eof", self._peer.theirs)
            return []
        arrived = self._peer.note(self, self._peer.theirs, data)
        self.messages += arrived
        return arrived


def _connect_narrowly(address: tuple[str, int], seconds: float) -> socket.socket:
    """As `socket.create_connection`; small segments keep the buffer of the other end small too."""
    failed = OSError("no address")
    for family, each in addresses(*address):
        sock = socket.socket(family, socket.SOCK_STREAM)
        sock.settimeout(seconds)
        for buffer in (socket.SO_RCVBUF, socket.SO_SNDBUF):
            sock.setsockopt(socket.SOL_SOCKET, buffer, NARROW_BYTES)
        with contextlib.suppress(AttributeError, OSError):  # not on every system
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, NARROW_SEGMENT)
        try:
            sock.connect(each)
        except OSError as error:
            sock.close()
            failed = error
        else:
            return sock
    raise failed


class Peer:
    """Listens to clients or dials a server; tells `on_open` of connections, `on_message` of
    messages.

    What it sends is on record as the server's, unless it plays the client.
    """

    def __init__(self, host: str, ports: dict[Channel, int], *, plays: str = "server") -> None:
        self.ours: Direction = "s2c" if plays == "server" else "c2s"
        self.theirs: Direction = "c2s" if plays == "server" else "s2c"
        self.host = host
        self.ports = dict(ports)
        self.narrow = False
        """Little of what the testee sends on new connections fits into the systems' buffers."""
        self.connections: list[Connection] = []
        self.entries: list[Entry] = []
        """What crossed the wire since `clear`."""
        self._assembler = Assembler()
        self.on_open: Callable[[Connection], None] = lambda connection: None
        self.on_message: Callable[[Connection, Message], None] = lambda connection, message: None
        self._selector = selectors.DefaultSelector()
        self._listeners: dict[Channel, socket.socket] = {}
        self.last_opened: dict[Channel, float] = dict.fromkeys(CHANNELS, 0.0)
        """When the last connection of each channel was made, by the monotonic clock."""
        self.listens_since: dict[Channel, float] = dict.fromkeys(CHANNELS, 0.0)
        """When it began to listen on each channel, since it last refused there."""
        self.late_seconds = 0.0
        """By how much the longest of all waits on this record was longer than asked for."""
        self.delays: Callable[[], Mapping[int, float]] = dict
        """How long each thread of the testee has waited for a processor, in seconds, by its id."""
        self._start = self._looked = time.monotonic()
        self._absent = 0.0
        self._asked = self._asked_at = self._clock = self._start
        self._delayed = 0.0
        self._before = 0.0, 0.0
        self._known: Mapping[int, float] = {}
        self._count = dict.fromkeys(CHANNELS, 0)

    def environment(self) -> dict[str, str]:
        """The variables that tell a testee of its address (spec 1.0 section 3.1)."""
        return {
            "SPLATBUS_HOST": self.host,
            "SPLATBUS_IPC_PORT": str(self.ports["ipc"]),
            "SPLATBUS_MSG_PORT": str(self.ports["msg"]),
        }

    def listen(self, channel: Channel) -> None:
        """Accept connections on this channel from now on; OSError if the port is taken."""
        listener = self._listeners.get(channel)
        if listener is None:
            if port := self.ports[channel]:
                listener = socket.create_server((self.host, port), backlog=16)
            else:
                listener = listen_somewhere(self.host)
                self.ports[channel] = listener.getsockname()[1]
            listener.setblocking(False)
            self._listeners[channel] = listener
            self.listens_since[channel] = time.monotonic()
        if listener not in self._selector.get_map():
            self._selector.register(listener, selectors.EVENT_READ, channel)

    def hold(self, channel: Channel) -> None:
        """Leave connections on this channel in the backlog, neither accepted nor refused."""
        self.listen(channel)
        self.forget(self._listeners[channel])

    def dial(self, channel: Channel, seconds: float = DIAL_SECONDS) -> Connection:
        """Connect to the testee on this channel; OSError if it does not accept in time."""
        connect = _connect_narrowly if self.narrow else socket.create_connection
        port = self.ports[channel]
        with self.waiting():
            sock = connect((self.host, port), seconds)
        connection = self._adopt(sock, channel, port)
        self.on_open(connection)
        return connection

    def refuse(self, channel: Channel) -> None:
        """Refuse connections on this channel from now on."""
        if listener := self._listeners.pop(channel, None):
            self.forget(listener)
            listener.close()

    def clock(self) -> float:
        """Seconds by which a testee's patience is measured: those do not count in which a busy
        machine kept the testee from running, or the harness from looking, for what came has not
        been seen then. Where both did, it goes on at the share in which the testee ran.
        """
        now = time.monotonic()
        looking = min(now, self._looked + GRACE_SECONDS) - self._absent
        if looking - self._asked > DELAYS_SECONDS:
            known, self._known = self._known, self.delays()
            longest = max((it - known.get(id, 0.0) for id, it in self._known.items()), default=0.0)
            share = min(longest / (now - self._asked_at), 1.0)
            self._delayed += share * (looking - self._asked)
            self._asked, self._asked_at = looking, now
        self._clock = max(self._clock, looking - self._delayed)
        return self._clock

    @contextlib.contextmanager
    def waiting(self) -> Iterator[None]:
        """While it waits for the testee in a call of the system's, the harness looks, too."""
        self._looks_again()
        try:
            yield
        finally:
            self._looked = time.monotonic()

    def _looks_again(self) -> None:
        now = time.monotonic()
        self._absent += max(0.0, now - self._looked - GRACE_SECONDS)
        self._looked = now

    def kept_seconds(self) -> float:
        """For how long, on this record, the harness did not look, or a busy machine kept the testee
        from running.
        """
        self._looks_again()
        absent, delayed = self._before
        return max(self._absent - absent, self._delayed - delayed)

    def pump(self, seconds: float = 0.0) -> None:
        """Handle what happens within `seconds`; at least what has happened already."""
        deadline = time.monotonic() + seconds
        while True:
            self._step(max(0.0, deadline - time.monotonic()))
            if time.monotonic() >= deadline:
                return

    def until(self, condition: Callable[[], T], seconds: float) -> T:
        """Pump until `condition` gives something true, or `seconds` pass by `clock`; what it gave
        last.
        """
        deadline = self.clock() + seconds
        while not (given := condition()) and (left := deadline - self.clock()) > 0:
            self._step(min(left, TICK_SECONDS))
        return given

    def newest(self, channel: Channel, suits: Callable[[Connection], object]) -> Connection | None:
        """The newest connection on a channel that suits."""
        there = (it for it in reversed(self.connections) if it.channel == channel and suits(it))
        return next(there, None)

    def close_all(self) -> None:
        """Close every connection."""
        for connection in self.connections:
            connection.close()

    def clear(self) -> None:
        """Close every connection and begin a new record.

        So are connections that the harness, which had not looked for long, has kept waiting: what
        becomes of them is its own doing.
        """
        if time.monotonic() - self._looked > AWAY_SECONDS:
            for channel in self._listeners:
                while self._accepted(channel):
                    pass
        self.late_seconds, self._before = 0.0, (self._absent, self._delayed)
        self.close_all()
        self.connections = []
        self.entries = []
        self._assembler = Assembler()

    def close(self) -> None:
        """Close everything."""
        self.clear()
        for channel in CHANNELS:
            self.refuse(channel)
        self._selector.close()

    def note(
        self, connection: Connection, direction: Direction, data: bytes, at: float | None = None
    ) -> list[Message]:
        """Put bytes on record, as of now or of this time on it; the messages that they complete."""
        t = self.now() if at is None else at
        return self._put(Entry(t, connection.channel, connection.number, direction, data))[1]

    def note_event(self, connection: Connection, event: Event, direction: Direction) -> None:
        """Put an event on record."""
        self._put(Entry(self.now(), connection.channel, connection.number, direction, event=event))

    def _put(self, entry: Entry) -> tuple[Conversation, list[Message]]:
        self.entries.append(entry)
        return self._assembler.feed(entry)

    def conversations(self) -> list[Conversation]:
        """What is on record, as if it ended here."""
        return self._assembler.so_far()

    def forget(self, sock: socket.socket) -> None:
        """Stop watching a socket."""
        with contextlib.suppress(KeyError, ValueError):
            self._selector.unregister(sock)

    def _step(self, seconds: float) -> None:
        self._looks_again()
        began = self._looked
        happened = self._selector.select(seconds)
        self._looked = time.monotonic()
        late = self._looked - began - seconds
        self.late_seconds = max(self.late_seconds, late)
        self._absent += max(0.0, late - GRACE_SECONDS)
        for _ in range(MOST_ROUNDS):
            if not happened:
                break
            for key, _ in happened:
                if isinstance(key.data, Connection):
                    self._handle(key.data)
                elif connection := self._accepted(key.data):
                    self.on_open(connection)
            happened = self._selector.select(0)

    def on_record(self, monotonic: float) -> float:
        """The time of an entry that was made at this time of the monotonic clock."""
        return monotonic - self._start

    def by_clock(self, t: float) -> float:
        """The time by the monotonic clock of an entry that was made at `t`."""
        return self._start + t

    def now(self) -> float:
        """The time on record."""
        return self.on_record(time.monotonic())

    def _accepted(self, channel: Channel) -> Connection | None:
        try:
            sock, address = self._listeners[channel].accept()
        except OSError:
            return None
        return self._adopt(sock, channel, address[1])

    def _adopt(self, sock: socket.socket, channel: Channel, testee_port: int) -> Connection:
        sock.settimeout(SEND_SECONDS)
        with contextlib.suppress(OSError):  # it may have been reset while it was not looked at
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._count[channel] += 1
        number = self._count[channel]
        conversation, _ = self._put(Entry(self.now(), channel, number, event="open"))
        stream = conversation.streams[self.theirs]
        connection = Connection(self, sock, channel, number, testee_port, stream)
        self.last_opened[channel] = connection.opened
        self.connections.append(connection)
        self._selector.register(sock, selectors.EVENT_READ, connection)
        return connection

    def _handle(self, connection: Connection) -> None:
        for message in connection.read():
            self.on_message(connection, message)
        if connection.ended:
            self.forget(connection._sock)
