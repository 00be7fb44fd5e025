"""The sockets of both channels, on one thread: bytes to connections, messages to the session.

No connection can hold up another or the renderer: every socket is non-blocking, each connection has
its turn and rests after it, what a client does not read waits within limits, and whatever goes
wrong with one connection ends that one only.
"""

from __future__ import annotations

import logging
import math
import selectors
import socket
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

from splatbus_wire.messages import Channel, ClientMessage, GetCameraPose, GetViewportSize, Hello

from splatbus_server.connection import Connection, Refusal, Terms
from splatbus_server.limits import DEFAULT, Limits
from splatbus_server.logs import log
from splatbus_server.peer import Peer, has_hung_up
from splatbus_server.session import Session
from splatbus_server.share import TURN_SECONDS, Share, clock

READ_BYTES = 16384
"""Taken from one connection before the others have their turn."""
PAUSE_SECONDS = 1.0
"""After a connection that the system would not accept, before the next is tried."""


class Service:
    """Serves both channels until it is told to stop."""

    def __init__(
        self,
        listeners: Mapping[Channel, socket.socket],
        session: Session,
        terms: Terms,
        limits: Limits = DEFAULT,
    ) -> None:
        self._listeners = listeners
        self._limits = limits
        self._session = session
        self._terms = terms
        self._statistics = session.statistics
        self.peers: list[Peer] = []
        self._share_of_accepting = Share()
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
                try:
                    self._turn()
                except Exception:
                    log.exception("a defect of this server: every connection ends, others may come")
                    self._begin_anew()
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
        now = time.monotonic()
        wait = None if deadline == math.inf else max(0.0, deadline - now)
        if self._session.has_news or any(map(self._is_due, self.peers)):
            wait = 0.0
        for key, _ in self.selector.select(wait):
            key.data()
        now = time.monotonic()
        if now >= deadline:
            self._meet_deadlines(now)
        self._hear_on()
        if self._session.has_news:
            self._session.catch_up(now)
        self._do_chores()
        for peer in [p for p in self.peers if p.connection.unsent or p.connection.ending]:
            self.flush(peer, now)

    def _meet_deadlines(self, now: float) -> None:
        if now >= self._accept_from:
            self._accept_again()
        for peer in self.peers:
            if now >= peer.connection.deadline:
                peer.connection.expire(now)
                peer.is_behind = True
        if now >= self._session.deadline:
            self._session.has_news = True

    def _hear_on(self) -> None:
        """Goes on with what clients sent that had to wait."""
        for peer in list(filter(self._is_due, self.peers)):
            self._guarded(peer, self._handle_all)

    def _is_due(self, peer: Peer) -> bool:
        return peer.is_behind and peer.connection.is_ready

    def _begin_anew(self) -> None:
        """Ends all connections, whatever state they are in."""
        for peer in self.peers[:]:
            with suppress(Exception):
                self.drop(peer)
            peer.socket.close()
        self.peers.clear()
        for key in [*self.selector.get_map().values()]:
            with suppress(Exception):
                self.selector.unregister(key.fileobj)
        self.selector.register(self._bell, selectors.EVENT_READ, self._on_bell)
        self._accept_from = time.monotonic() + PAUSE_SECONDS

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
        self._accept_from = self._share_of_accepting.rests_until = math.inf
        for channel, listener in self._listeners.items():
            if listener not in self.selector.get_map():
                accept = self.accepting(channel, listener)
                self.selector.register(listener, selectors.EVENT_READ, accept)

    def _pause_accepting(self, until: float) -> None:
        self._accept_from = until
        for listener in self._listeners.values():
            if listener in self.selector.get_map():
                self.selector.unregister(listener)

    def accepting(self, channel: Channel, listener: socket.socket) -> Callable[[], None]:
        """What is to be done when clients knock: take them in, as long as a turn lasts."""

        def accept() -> None:
            began, share = clock(), self._share_of_accepting
            while self._accept_from == math.inf and self.accept(channel, listener):
                if clock() - began > TURN_SECONDS:
                    break
            self._charge(share, clock() - began)
            if share.is_resting and self._accept_from == math.inf:
                self._pause_accepting(share.rests_until)

        return accept

    def accept(self, channel: Channel, listener: socket.socket) -> bool:
        """Takes a client in, or turns it away where there are too many [LIM-1, CHN-13].

        Returns whether there may be another.
        """
        try:
            accepted, address = listener.accept()
        except (BlockingIOError, InterruptedError, ConnectionError):
            return False
        except OSError as error:  # no more files, no more memory
            log.error("%s: cannot accept a connection: %s", channel, error)
            self._pause_accepting(time.monotonic() + PAUSE_SECONDS)
            return False
        name = f"{channel} {address[0]}:{address[1]}"
        if not self._has_room(channel):
            most = self._limits.connections
            log.warning("%s: refused, %d connections are open [LIM-1]", name, most)
            self._statistics.refused["too_many_connections"] += 1
            accepted.close()
            return True
        accepted.setblocking(False)
        with suppress(OSError):  # where the client is gone already
            accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            accepted.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        peer = Peer(name, accepted, Connection(channel, self._terms, time.monotonic()))
        self.peers.append(peer)
        self._statistics.connections += 1
        if channel == "ipc" and self._terms.token is None:
            self._session.join(peer.connection)
        self.selector.register(accepted, selectors.EVENT_READ, lambda: self._serve(peer))
        log.info("%s: connected", name)
        return True

    def _has_room(self, channel: Channel) -> bool:
        """Whether one more can be served, after the one that has least to lose made room [CHN-25].

        Such are connections that end, then those that have said nothing valid, but never the only
        one, then those whose client has gone, the oldest first. With a token, strangers have half
        of the places.
        """
        most = self._limits.connections
        there = [p for p in self.peers if p.connection.channel == channel]
        strangers = [p for p in there if not p.connection.is_known]
        is_guarded = self._terms.token is not None
        if len(there) < most and not (is_guarded and len(strangers) >= most // 2 > 0):
            return True
        for peer in there:
            if not peer.connection.is_open:
                return self._make_room(peer)
        for peer in strangers if len(there) > 1 else ():
            self._serve(peer)  # what it said may wait to be read
            if not peer.connection.is_known:
                return self._make_room(peer)
        for peer in there:
            if peer not in self.peers or has_hung_up(peer.socket):
                return self._make_room(peer)
        return len(there) < most

    def _make_room(self, peer: Peer) -> bool:
        if peer in self.peers:
            peer.connection.abort("it made room for another client [CHN-25]")
            self._statistics.refused["made_room"] += 1
            self.flush(peer, time.monotonic())
        return True

    def _serve(self, peer: Peer) -> None:
        self._guarded(peer, self._read)

    def _guarded(self, peer: Peer, work: Callable[[Peer], None]) -> None:
        if peer not in self.peers:  # it made room for another in this turn
            return
        began = clock()
        try:
            work(peer)
            if peer in self.peers:
                self._charge(peer.connection, clock() - began)
                self.flush(peer, time.monotonic())
        except Exception:
            log.exception("%s: dropped because of a defect of this server", peer.name)
            if peer in self.peers:
                self.drop(peer)

    def _charge(self, whom: Connection | Share, worked: float) -> None:
        now = time.monotonic()
        owing = sum(now < peer.connection.share.owes_until for peer in self.peers)
        whom.charge(worked, owing, now)

    def _read(self, peer: Peer) -> None:
        if peer.connection.input_ended or peer.waits:
            return
        try:
            data = peer.socket.recv(READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            log.info("%s: lost: %s", peer.name, error.strerror)
            self.drop(peer)
            return
        self.take(peer, data)

    def take(self, peer: Peer, data: bytes) -> None:
        """Hands on what a read returned."""
        peer.connection.receive(data, time.monotonic())
        self._handle_all(peer)

    def _handle_all(self, peer: Peer) -> None:
        """Handles what has come, as long as the connection's turn lasts."""
        connection, now, began = peer.connection, time.monotonic(), clock()
        peer.is_behind = False
        while (event := connection.next_event(now)) is not None:
            refusal = event if isinstance(event, Refusal) else self._handle(peer, event, now)
            if refusal is not None:
                self._note(peer, refusal)
            if clock() - began > TURN_SECONDS:
                peer.is_behind = True
                break
        peer.is_behind = peer.is_behind or not connection.is_ready

    def _handle(self, peer: Peer, message: ClientMessage, now: float) -> Refusal | None:
        """Does what a message asks for; a defect in that is not the client's, who may go on."""
        connection = peer.connection
        if isinstance(message, Hello) and connection.welcome is not None:
            version, _, capabilities = connection.welcome
            agreed = " ".join((version, *capabilities))
            log.info("%s: hello from %r %r, speaks %s", peer.name, *message.client, agreed)
            if message.capabilities and not capabilities:
                told = ", ".join(message.capabilities)
                log.warning("%s: grants none of %s: has it swapped the two ports?", peer.name, told)
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
        events = 0 if connection.input_ended or peer.waits else selectors.EVENT_READ
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
