"""The sockets of both channels, on one thread: bytes to connections, messages to the session.

No connection can hold up another or the renderer: every socket is non-blocking, what a client does
not read waits within limits, and whatever goes wrong with one connection ends that one only.
"""

from __future__ import annotations

import logging
import math
import selectors
import socket
import time
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field

from splatbus_wire.messages import Channel, ClientMessage, GetCameraPose, GetViewportSize, Hello

from splatbus_server.connection import Connection, Refusal, Terms
from splatbus_server.session import Session
from splatbus_server.statistics import Statistics

MOST_CONNECTIONS = 8
"""On each channel [LIM-1]."""
READ_BYTES = 16384
"""Taken from one connection before the others have their turn."""
PAUSE_SECONDS = 1.0
"""After a connection that the system would not accept, before the next is tried."""

log = logging.getLogger("splatbus_server")


@dataclass(eq=False)
class Peer:
    """A connection and its socket.

    Attributes:
        name: for the log.
        awaits: what the selector looks out for; nothing while it is not registered there.
        noted: how often was refused what, by the error's code.
        is_held: what it sends is not looked at for the time being.
        is_ending: the log says already why the connection ends.
        is_shut: the client has been told that nothing more will come.
    """

    name: str
    socket: socket.socket
    connection: Connection
    awaits: int = selectors.EVENT_READ
    noted: Counter[str] = field(default_factory=Counter)
    is_held: bool = False
    is_shut: bool = False
    is_ending: bool = False


class Service:
    """Serves both channels until it is told to stop."""

    def __init__(
        self,
        listeners: Mapping[Channel, socket.socket],
        session: Session,
        terms: Terms,
        statistics: Statistics,
    ) -> None:
        self._listeners = listeners
        self._session = session
        self._terms = terms
        self._statistics = statistics
        self.peers: list[Peer] = []
        self.selector = selectors.DefaultSelector()
        self._aside = ThreadPoolExecutor(1, "splatbus-memory")
        self._bell, self._ringer = socket.socketpair()
        self._bell.setblocking(False)
        self._ringer.setblocking(False)
        self._rung = False
        self._stopping = False
        self._accept_from = math.inf
        self.selector.register(self._bell, selectors.EVENT_READ, self._on_bell)
        self._accept_again()

    def ring(self) -> None:
        """From another thread: there is news to pass on to clients."""
        if not self._rung:
            self._rung = True
            with suppress(OSError):  # closed meanwhile, or enough rings are on their way
                self._ringer.send(b"!")

    def stop(self) -> None:
        """From another thread: makes `run` return."""
        self._stopping = True
        self._rung = False
        self.ring()

    def run(self) -> None:
        """Serves; closes every socket at the end."""
        try:
            while not self._stopping:
                self._turn()
        finally:
            for peer in self.peers:
                peer.socket.close()
            for listener in self._listeners.values():
                listener.close()
            self.selector.close()
            self._aside.shutdown()
            self._bell.close()
            self._ringer.close()

    def _turn(self) -> None:
        deadlines = [p.connection.deadline for p in self.peers]
        deadline = min([self._accept_from, self._session.deadline, *deadlines])
        wait = None if deadline == math.inf else max(0.0, deadline - time.monotonic())
        for key, _ in self.selector.select(wait):
            key.data()
        now = time.monotonic()
        if now >= deadline:
            self._meet_deadlines(now)
        while self._session.has_news:
            self._session.catch_up(now)
            self._hear_on()
        self._do_chores()
        for peer in [p for p in self.peers if p.connection.unsent or p.connection.ending]:
            self.flush(peer, now)

    def _meet_deadlines(self, now: float) -> None:
        if now >= self._accept_from:
            self._accept_again()
        for peer in self.peers:
            if now >= peer.connection.deadline:
                peer.connection.expire(now)
        if now >= self._session.deadline:
            self._session.has_news = True

    def _hear_on(self) -> None:
        """Goes on with what clients sent behind a request whose reply took time."""
        for peer in [p for p in self.peers if p.is_held and not p.connection.is_held]:
            self._guarded(peer, self._handle_all)

    def _do_chores(self) -> None:
        chores = self._session.viewport.chores
        while chores:
            self._aside.submit(self._do, chores.pop(0))

    def _do(self, chore: Callable[[], None]) -> None:
        try:
            chore()
        except Exception:
            log.exception("a defect of this server")
        self.ring()

    def _on_bell(self) -> None:
        with suppress(BlockingIOError):
            self._bell.recv(64)
        # Only now: a ring before this is in what was just read, one after it sends another byte.
        self._rung = False
        self._session.has_news = True

    def _accept_again(self) -> None:
        self._accept_from = math.inf
        for channel, listener in self._listeners.items():
            accept = self.accepting(channel, listener)
            self.selector.register(listener, selectors.EVENT_READ, accept)

    def accepting(self, channel: Channel, listener: socket.socket) -> Callable[[], None]:
        """What is to be done when a client knocks."""
        return lambda: self.accept(channel, listener)

    def accept(self, channel: Channel, listener: socket.socket) -> None:
        """Takes a client in, or turns it away where there are too many [LIM-1]."""
        now = time.monotonic()
        try:
            accepted, address = listener.accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return
        except OSError as error:  # no more files, no more memory
            log.error("%s: cannot accept a connection: %s", channel, error)
            self._accept_from = now + PAUSE_SECONDS
            for paused in self._listeners.values():
                self.selector.unregister(paused)
            return
        name = f"{channel} {address[0]}:{address[1]}"
        if sum(p.connection.channel == channel for p in self.peers) >= MOST_CONNECTIONS:
            log.warning("%s: refused, %d connections are open [LIM-1]", name, MOST_CONNECTIONS)
            self._statistics.refused["too_many_connections"] += 1
            accepted.close()
            return
        accepted.setblocking(False)
        with suppress(OSError):  # where the client is gone already
            accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        peer = Peer(name, accepted, Connection(channel, self._terms, now))
        self.peers.append(peer)
        self._statistics.connections += 1
        if channel == "ipc" and self._terms.token is None:
            self._session.join(peer.connection)
        self.selector.register(accepted, selectors.EVENT_READ, lambda: self._serve(peer))
        log.info("%s: connected", name)

    def _serve(self, peer: Peer) -> None:
        self._guarded(peer, self._read)

    def _guarded(self, peer: Peer, work: Callable[[Peer], None]) -> None:
        try:
            work(peer)
        except Exception:
            log.exception("%s: dropped because of a defect of this server", peer.name)
            if peer in self.peers:
                self.drop(peer)

    def _read(self, peer: Peer) -> None:
        connection = peer.connection
        if not connection.input_ended and not peer.is_held:
            try:
                data = peer.socket.recv(READ_BYTES)
            except (BlockingIOError, InterruptedError):
                data = None
            except OSError as error:
                log.info("%s: lost: %s", peer.name, error.strerror)
                self.drop(peer)
                return
            if data is not None:
                self.take(peer, data)
        self.flush(peer, time.monotonic())

    def take(self, peer: Peer, data: bytes) -> None:
        """Hands on what a read returned."""
        peer.connection.receive(data, time.monotonic())
        self._handle_all(peer)

    def _handle_all(self, peer: Peer) -> None:
        connection, now = peer.connection, time.monotonic()
        while (event := connection.next_event(now)) is not None:
            refusal = event if isinstance(event, Refusal) else self._handle(peer, event, now)
            if refusal is not None:
                self._note(peer, refusal)
        peer.is_held = connection.is_held

    def _handle(self, peer: Peer, message: ClientMessage, now: float) -> Refusal | None:
        """Does what a message asks for; a defect in that is not the client's, who may go on."""
        connection = peer.connection
        if isinstance(message, Hello) and connection.welcome is not None:
            version, _, capabilities = connection.welcome
            agreed = " ".join((version, *capabilities))
            log.info("%s: hello from %r %r, speaks %s", peer.name, *message.client, agreed)
        try:
            return self._session.handle(connection, message, now)
        except Exception:
            log.exception("%s: %s failed, a defect of this server", peer.name, message)
            if connection.welcome is None and isinstance(message, (GetViewportSize, GetCameraPose)):
                connection.end("there is no reply, and 1.0 has no error for that [REQ-9]", now)
            request = getattr(message, "id", None)
            return connection.complain(Refusal("internal", "a defect of this server", id=request))

    def _note(self, peer: Peer, refusal: Refusal) -> None:
        """Counts a refusal; logs the first of its kind, for a client may repeat it forever."""
        self._statistics.refused[refusal.code] += 1
        peer.noted[refusal.code] += 1
        if peer.noted[refusal.code] == 1:
            log.warning("%s: refused: %s: %s", peer.name, refusal.code, refusal.reason)

    def flush(self, peer: Peer, now: float) -> None:
        """Sends what can be sent, ends what is to be ended, waits for what must be waited for."""
        connection = peer.connection
        if connection.unsent:
            try:
                count = peer.socket.send(connection.unsent)
            except (BlockingIOError, InterruptedError):
                count = 0
            except OSError as error:
                log.info("%s: lost: %s", peer.name, error.strerror)
                self.drop(peer)
                return
            connection.sent(count, now)
        if not connection.is_open and not peer.is_ending:
            peer.is_ending = True
            level = logging.INFO if connection.input_ended else logging.WARNING
            log.log(level, "%s: ends: %s", peer.name, connection.ending)
        if connection.over:
            self.drop(peer)
            return
        if not connection.is_open and not connection.unsent and not peer.is_shut:
            peer.is_shut = True
            with suppress(OSError):
                peer.socket.shutdown(socket.SHUT_WR)
        events = 0 if connection.input_ended or peer.is_held else selectors.EVENT_READ
        events |= selectors.EVENT_WRITE if connection.unsent else 0
        self._await(peer, events)

    def _await(self, peer: Peer, events: int) -> None:
        if events == peer.awaits:
            return
        if not events:
            self.selector.unregister(peer.socket)
        elif not peer.awaits:
            self.selector.register(peer.socket, events, lambda: self._serve(peer))
        else:
            self.selector.modify(peer.socket, events, lambda: self._serve(peer))
        peer.awaits = events

    def drop(self, peer: Peer) -> None:
        """Closes a connection for good, and tells the session so."""
        self._await(peer, 0)
        self.peers.remove(peer)
        peer.socket.close()
        self._session.leave(peer.connection)
        refused = f"; refused: {dict(peer.noted)}" if peer.noted else ""
        log.info("%s: closed%s", peer.name, refused)
