"""One channel's socket and its life: connect, lose, wait, connect again [1.0 chapter 3].

No method blocks. Whoever owns a channel calls `ready` when its socket is, `advance` when its
deadline has passed, and `flush` after giving its machine something to send.
"""

from __future__ import annotations

import contextlib
import logging
import os
import selectors
import socket
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Protocol

from splatbus_schemas import LIMITS
from splatbus_schemas.visible import visible
from splatbus_wire.messages import Program

from splatbus_client.backoff import LONGEST, delays
from splatbus_client.complaints import Complaints
from splatbus_client.events import Event, Ignored, MustClose, Negotiated, Refused, ServerError

log = logging.getLogger("splatbus_client")

_CONNECT_SECONDS: float = LIMITS["reconnect_max_seconds"]
_RECEIVE_BYTES = 16384  # so much is done before others have their turn
_KEEP_ALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPALIVE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3}
"""Seconds of silence before the system asks the other one's, by the names of Linux and Windows and
of macOS; seconds between questions; and how many may go unanswered."""


Tap = Callable[[str, str, bytes], None]
"""Is told the name of a channel, `"connected"`, `"sent"` or `"received"`, and the bytes: whole, the
token too, at once, with the session's lock held. It must return soon, and call nothing of that."""


class Machine(Protocol):
    """What the protocol machines of both channels have in common; each lives for a connection."""

    def receive(self, data: bytes, now: float) -> Iterable[Event]: ...  # noqa: D102
    def expire(self, now: float) -> Iterable[Event]: ...  # noqa: D102
    def deadline(self) -> float: ...  # noqa: D102
    def data_to_send(self, now: float) -> bytes: ...  # noqa: D102


class Owner(Protocol):
    """Whoever follows the connections of a channel."""

    def begin(self) -> Machine: ...  # noqa: D102
    def handle(self, event: Any) -> bool | None:
        """Whether what the event complains of is over already."""

    def end(self) -> None: ...  # noqa: D102


class ChannelStatus(NamedTuple):
    """How a channel fares.

    Attributes:
        connected: whether a connection is open now.
        connections: how many there have been.
        version: what the server speaks on it, once that is known.
        server: what the server calls itself, if it does.
        capabilities: what both sides can do on it, once that is known.
        problem: why there is no connection, or what the server last complained of, until a pose
            that was sent later is seen to be taken.
    """

    connected: bool = False
    connections: int = 0
    version: str | None = None
    server: Program | None = None
    capabilities: frozenset[str] = frozenset()
    problem: str | None = None


class Channel:
    """Keeps one connection to a server, as far as the server lets it.

    Args:
        name: for people.
        host: name or address of the server.
        port: of the channel.
        owner: makes the machine of each new connection, handles what is announced, lent or
            answered on it, and is told of its end.
        tap: is told of all bytes, if anybody is.

    Raises:
        OSError: the host's name cannot be resolved.
    """

    def __init__(
        self, name: str, host: str, port: int, owner: Owner, tap: Tap | None = None
    ) -> None:
        self.socket: socket.socket | None = None
        self.status = ChannelStatus()
        self.name, self._where = name, f"{host}:{port}"
        self._owner, self._tap = owner, tap
        try:
            self._addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except socket.gaierror as error:
            raise OSError(f"cannot find the host {host!r}: {error.strerror}") from None
        self.machine: Machine | None = None
        self.unsent = memoryview(b"")
        self._delays = delays()
        self.due = 0.0  # while there is no connection: when to begin, or to give up, an attempt
        self._connected_at = 0.0
        self._welcome = False  # whether the last that was heard, if anything, was no complaint
        self._complaints = Complaints(log)

    def interest(self) -> int:
        """Return what to wait for on `socket`: a mask of `selectors`, 0 if there is none."""
        if self.socket is None:
            return 0
        if self.machine is None:
            return selectors.EVENT_WRITE
        return selectors.EVENT_READ | (selectors.EVENT_WRITE if self.unsent else 0)

    def deadline(self) -> float:
        """Return when `advance` is to be called next; infinity for never."""
        return self.due if self.machine is None else self.machine.deadline()

    def advance(self, now: float) -> None:
        """Do what the time asks for."""
        if self.machine is not None:
            self._take(self.machine.expire(now), now)
            self.flush(now)
        elif now >= self.due:
            if self.socket is None:
                self.connect(now)
            else:
                self.lose(f"no answer within {_CONNECT_SECONDS:g} s", now)

    def ready(self, mask: int, now: float) -> None:
        """Do what the socket is ready for, according to a mask of `selectors`."""
        if self.socket is None:
            return
        if self.machine is None:
            self._finish_connecting(now)
            return
        if mask & selectors.EVENT_READ:
            self._receive(self.socket, self.machine, now)
        self.flush(now)

    def flush(self, now: float) -> None:
        """Send what the machine has to send, as far as the socket takes it."""
        try:
            while self.socket is not None and self.machine is not None:
                if not self.unsent:
                    self.unsent = memoryview(self.machine.data_to_send(now))
                if not self.unsent:
                    return
                sent = self.socket.send(self.unsent)
                if self._tap is not None:
                    self._tap(self.name, "sent", bytes(self.unsent[:sent]))
                self.unsent = self.unsent[sent:]
        except BlockingIOError:
            pass
        except OSError as error:
            self.lose(_reason(error), now)

    def settle(self) -> None:
        """Take note that what the server complained of is over."""
        if self.machine is not None:
            self.status = self.status._replace(problem=None)

    def close(self) -> None:
        """End the connection, and do not connect again."""
        if self.socket is not None:
            self.socket.close()
            self.socket = None
        if self.machine is not None:
            self.machine = None
            self._owner.end()

    def connect(self, now: float) -> None:
        """Begin an attempt, on the next address that the name has."""
        # A name may have several addresses: one attempt each, in turn.
        self._addresses.append(self._addresses.pop(0))
        family, kind, protocol, _, address = self._addresses[-1]
        self.due = now + _CONNECT_SECONDS
        try:
            self.socket = socket.socket(family, kind, protocol)
            self.socket.setblocking(False)
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # [FRM-8]
            _keep_alive(self.socket)
            self.socket.connect(address)
        except BlockingIOError:
            pass
        except OSError as error:
            self.lose(_reason(error), now)

    def _finish_connecting(self, now: float) -> None:
        assert self.socket is not None
        error = self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if error:
            self.lose(os.strerror(error), now)
            return
        try:
            peer = self.socket.getpeername()
        except OSError:
            return  # not connected yet
        if peer == self.socket.getsockname():
            # TCP lets a socket connect to itself when the system lends it, as its own port, the
            # very port where no server listens.
            self.lose("connection refused", now)
            return
        self.unsent = memoryview(b"")
        self._connected_at = now
        self._welcome = False
        self.machine = self._owner.begin()
        self.status = ChannelStatus(True, self.status.connections + 1)
        log.info("%s channel connected to %s", self.name, self._where)
        if self._tap is not None:
            self._tap(self.name, "connected", b"")
        self.flush(now)

    def _receive(self, connection: socket.socket, machine: Machine, now: float) -> None:
        try:
            data = connection.recv(_RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self.lose(_reason(error), now)
            return
        if data:
            if self._tap is not None:
                self._tap(self.name, "received", data)
            self._take(machine.receive(data, now), now)
        else:
            self.lose("the server ended it", now)  # [CHN-17]

    def _take(self, events: Iterable[Event], now: float) -> None:
        for event in events:
            if isinstance(event, MustClose):
                self.lose(event.reason, now)
                return
            if isinstance(event, Ignored):
                self._warn(f"ignored a packet: {event.reason}")
                continue
            if isinstance(event, ServerError) or (
                isinstance(event, Refused) and self.status.version is None  # hello was refused
            ):
                self._welcome = False
                problem = visible(f"the server says {event.error.code}: {event.error.message}")
                self.status = self.status._replace(problem=problem)
                self._warn(problem)
                if self._owner.handle(event):
                    self.settle()
                continue
            if isinstance(event, Negotiated):
                self.status = self.status._replace(**event._asdict())
            self._welcome = True
            self._owner.handle(event)

    def lose(self, reason: str, now: float) -> None:
        """Give up the connection or the attempt, and set when the next attempt begins [CHN-20]."""
        reason = visible(reason)
        connection, self.socket = self.socket, None
        machine, self.machine = self.machine, None
        if connection is not None:
            with contextlib.suppress(OSError):
                connection.close()
        if machine is None:
            self._warn(
                f"cannot connect to {self._where}: {reason}; trying again until a server runs"
                " there (start one with: splatbus-server)"
            )
        else:
            if self._welcome or now - self._connected_at >= LONGEST:
                self._delays = delays()
            if self.status.problem is not None:
                reason = f"{reason}; {self.status.problem}"
            self._warn(f"connection lost: {reason}")
            self._owner.end()
        self.due = now + next(self._delays)
        self.status = ChannelStatus(False, self.status.connections, problem=reason)

    def _warn(self, message: str) -> None:
        self._complaints.say(f"{self.name} channel: {message}")


def _keep_alive(connection: socket.socket) -> None:
    """Have a host that vanished noticed within a minute, where nothing is sent to it."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _KEEP_ALIVE.items():
        if hasattr(socket, name):
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
