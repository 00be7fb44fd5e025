"""A relay between clients and a server: passes bytes on at once, and tells what passed.

It changes nothing, and reads no further than it could pass on: a peer that stalls is felt by the
other as if they were connected directly. What it tells is a recording (conformance/RECORDING.md).
"""

from __future__ import annotations

import contextlib
import errno
import os
import selectors
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from splatbus_conformance.observe.door import Door
from splatbus_conformance.wire.places import Address, addresses
from splatbus_conformance.wire.recording import Channel, Direction, Entry, Event
from splatbus_conformance.wire.sockets import RESET_ON_CLOSE

READ_BYTES = 65536
NAP_SECONDS = 0.2
CALM_SECONDS = 0.001
MOST_UNTOLD = 32
UNDER_WAY = (0, errno.EINPROGRESS, errno.EWOULDBLOCK)

Note = Callable[[Entry], None]


@dataclass(eq=False)
class _Stream:
    """One direction of a connection: what one socket receives, the other sends on."""

    direction: Direction
    source: socket.socket
    sink: socket.socket
    pending: memoryview = field(default_factory=lambda: memoryview(b""))
    ended: bool = False


@dataclass(eq=False)
class _Caller:
    """A client's connection, and what was heard at the door."""

    channel: Channel
    client: socket.socket
    said: list[bytes] = field(default_factory=list)

    @property
    def sockets(self) -> tuple[socket.socket]:
        """The client's."""
        return (self.client,)


@dataclass(eq=False)
class _Attempt:
    """A client's connection, and the one to the server that is being made for it."""

    caller: _Caller
    server: socket.socket
    others: Sequence[Address]
    """Where else the server may be, if it is not there."""

    @property
    def sockets(self) -> tuple[socket.socket, socket.socket]:
        """The client's, and the one to the server."""
        return self.caller.client, self.server


@dataclass(eq=False)
class _Link:
    """A client's connection, and the one to the server that was made for it."""

    channel: Channel
    number: int
    streams: tuple[_Stream, _Stream]

    @property
    def sockets(self) -> tuple[socket.socket, socket.socket]:
        """The client's, and the one to the server."""
        return self.streams[0].source, self.streams[0].sink

    def facing(self, stream: _Stream) -> _Stream:
        """The other direction."""
        return self.streams[0] if stream is self.streams[1] else self.streams[1]


class Relay:
    """Relays both channels, on the thread that calls `run`.

    Args:
        listeners: bound sockets that clients connect to.
        servers: host and port that each channel is passed on to.
        note: is told of each piece and each end, after it was passed on; `t` is on the monotonic
            clock, counted from the start.
        missed: is told when a client comes and no server is there, and why; the client is reset.
        door: lets clients in, before anything of theirs is passed on or told; without one, all.

    Raises:
        OSError: the name of a server's host means nothing.
    """

    def __init__(
        self,
        listeners: Mapping[Channel, socket.socket],
        servers: Mapping[Channel, tuple[str, int]],
        note: Note,
        missed: Callable[[Channel, str], None] = lambda channel, reason: None,
        door: Door | None = None,
    ) -> None:
        self._listeners = dict(listeners)
        # Asked once: the answer may take seconds, in which nothing would pass.
        self._servers = {channel: addresses(*place) for channel, place in servers.items()}
        self._note = note
        self._missed = missed
        self._door = door
        self._start = time.monotonic()
        self._counts = dict.fromkeys(self._listeners, 0)
        self._open: set[_Caller | _Attempt | _Link] = set()
        self._untold: list[Entry] = []
        self._stopping = False
        self._selector = selectors.DefaultSelector()
        for channel, listener in self._listeners.items():
            listener.setblocking(False)
            self._selector.register(listener, selectors.EVENT_READ, channel)

    def stop(self) -> None:
        """From another thread or a signal: makes `run` return, within a moment."""
        self._stopping = True

    def run(self) -> None:
        """Relay until `stop`; closes every socket at the end."""
        try:
            while not self._stopping:
                self.turn(NAP_SECONDS)
            self._tell_all()
        finally:
            for each in (socket for one in self._open for socket in one.sockets):
                each.close()
            for listener in self._listeners.values():
                listener.close()
            self._selector.close()

    def turn(self, timeout: float) -> None:
        """Wait for at most `timeout` seconds, then pass on all that is there.

        What has passed is told once nothing more comes for a moment: whoever was sent something
        may need this processor.
        """
        events = self._selector.select(min(timeout, CALM_SECONDS) if self._untold else timeout)
        for key, mask in events:
            if isinstance(key.data, _Link):
                if key.data in self._open:  # an event before this one may have ended it
                    self._serve(key.data, key.fileobj, mask)
            elif isinstance(key.data, _Attempt):
                self._connected(key.data)
            elif isinstance(key.data, _Caller):
                self._hear(key.data)
            else:
                self._accept(key.data)
        if not events or len(self._untold) >= MOST_UNTOLD:
            self._tell_all()

    def _tell_all(self) -> None:
        untold, self._untold = self._untold, []
        for entry in untold:
            self._note(entry)

    def _accept(self, channel: Channel) -> None:
        with contextlib.suppress(OSError):  # gone before it was accepted
            client, _ = self._listeners[channel].accept()
            _prepare(client)
            if self._door is None:
                self._connect(_Caller(channel, client), self._servers[channel])
                return
            caller = _Caller(channel, client)
            self._open.add(caller)
            self._selector.register(client, selectors.EVENT_READ, caller)

    def _hear(self, caller: _Caller) -> None:
        """Let a client in once it has said who may."""
        assert self._door is not None
        try:
            data = caller.client.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        caller.said.append(data)
        opens = self._door.opens(b"".join(caller.said)) if data else False
        if opens is None:
            return
        self._open.discard(caller)
        self._selector.unregister(caller.client)
        if opens:
            self._connect(caller, self._servers[caller.channel])
        else:
            self._door.refused(caller.channel)
            _reset(caller.client)

    def _connect(self, caller: _Caller, places: Sequence[Address], reason: str = "") -> None:
        """Connect to the first of these places that is not known at once to be empty."""
        for number, (family, address) in enumerate(places, 1):
            server = socket.socket(family, socket.SOCK_STREAM)
            _prepare(server)
            status = server.connect_ex(address)
            if status in UNDER_WAY:
                attempt = _Attempt(caller, server, places[number:])
                self._open.add(attempt)
                self._selector.register(server, selectors.EVENT_WRITE, attempt)
                return
            server.close()
            reason = os.strerror(status)
        self._missed(caller.channel, reason)
        _reset(caller.client)

    def _connected(self, attempt: _Attempt) -> None:
        caller, (client, server) = attempt.caller, attempt.sockets
        self._open.discard(attempt)
        self._selector.unregister(server)
        if status := server.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            server.close()
            self._connect(caller, attempt.others, os.strerror(status))
            return
        self._counts[caller.channel] += 1
        streams = _Stream("c2s", client, server), _Stream("s2c", server, client)
        link = _Link(caller.channel, self._counts[caller.channel], streams)
        self._open.add(link)
        self._untold.append(Entry(self._now(), link.channel, link.number, event="open"))
        for data in caller.said:
            self._tell_data(link, streams[0], data, self._now())
        streams[0].pending = memoryview(b"".join(caller.said))
        self._await(link)

    def _serve(self, link: _Link, ready: object, mask: int) -> None:
        changed = bool(mask & selectors.EVENT_WRITE)
        try:
            for stream in link.streams:
                if stream.sink is ready and mask & selectors.EVENT_WRITE:
                    self._flush(link, stream)
                if stream.source is ready and mask & selectors.EVENT_READ:
                    self._receive(link, stream)
                    changed |= bool(stream.pending) or stream.ended
        except _BrokenError as end:
            self._abort(link, end.stream)
        else:
            if changed:
                self._await(link)

    def _receive(self, link: _Link, stream: _Stream) -> None:
        try:
            data = stream.source.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            raise _BrokenError(stream) from None
        now = self._now()
        if data:
            stream.pending = memoryview(data)
            self._tell_data(link, stream, data, now)
        else:
            stream.ended = True
            self._tell(link, stream, "eof", now)
        self._flush(link, stream)

    def _flush(self, link: _Link, stream: _Stream) -> None:
        try:
            while stream.pending:
                stream.pending = stream.pending[stream.sink.send(stream.pending) :]
            if stream.ended:
                stream.sink.shutdown(socket.SHUT_WR)
        except BlockingIOError:
            pass
        except OSError:  # who reads this direction is gone: the other one says how
            raise self._gone(link, link.facing(stream)) from None

    def _gone(self, link: _Link, stream: _Stream) -> _BrokenError:
        """What a peer said before it reset the connection arrives, as it would without a relay."""
        with contextlib.suppress(OSError):
            while not stream.pending and (data := stream.source.recv(READ_BYTES)):
                self._tell_data(link, stream, data, self._now())
                stream.pending = memoryview(data)
                stream.pending = stream.pending[stream.sink.send(stream.pending) :]
        return _BrokenError(stream)

    def _await(self, link: _Link) -> None:
        """Look out for what can be done next; forget a link of which nothing is left."""
        if all(stream.ended and not stream.pending for stream in link.streams):
            self._close(link)
            return
        for each in link.sockets:
            mask = 0
            for stream in link.streams:
                if stream.source is each and not stream.ended and not stream.pending:
                    mask |= selectors.EVENT_READ
                if stream.sink is each and stream.pending:
                    mask |= selectors.EVENT_WRITE
            self._watch(each, mask, link)

    def _watch(self, each: socket.socket, mask: int, link: _Link) -> None:
        registered = self._selector.get_map().get(each)
        if registered is None:
            if mask:
                self._selector.register(each, mask, link)
        elif not mask:
            self._selector.unregister(each)
        elif registered.events != mask:
            self._selector.modify(each, mask, link)

    def _abort(self, link: _Link, stream: _Stream) -> None:
        """Pass a reset on, by resetting both; one of `stream`'s source, if it had not ended."""
        if not stream.ended:
            self._tell(link, stream, "reset", self._now())
        for each in link.sockets:
            self._watch(each, 0, link)
            _reset(each)
        self._open.discard(link)

    def _close(self, link: _Link) -> None:
        self._open.discard(link)
        for each in link.sockets:
            self._watch(each, 0, link)
            each.close()

    def _tell_data(self, link: _Link, stream: _Stream, data: bytes, now: float) -> None:
        self._untold.append(Entry(now, link.channel, link.number, stream.direction, data))

    def _tell(self, link: _Link, stream: _Stream, event: Event, now: float) -> None:
        self._untold.append(Entry(now, link.channel, link.number, stream.direction, event=event))

    def _now(self) -> float:
        return time.monotonic() - self._start


def _prepare(each: socket.socket) -> None:
    each.setblocking(False)
    each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _reset(each: socket.socket) -> None:
    with contextlib.suppress(OSError):
        each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
    each.close()


class _BrokenError(Exception):
    """A socket of a link failed: that of the stream's source."""

    def __init__(self, stream: _Stream) -> None:
        self.stream = stream
