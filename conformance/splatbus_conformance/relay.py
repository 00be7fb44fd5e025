"""A relay between clients and a server: passes bytes on at once, and tells what passed.

It changes nothing, and reads no further than it could pass on: a peer that stalls is felt by the
other as if they were connected directly. What it tells is a recording (conformance/RECORDING.md).
"""

from __future__ import annotations

import contextlib
import selectors
import signal
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from splatbus_conformance.recording import Channel, Direction, Entry, Event, to_line

READ_BYTES = 65536
NAP_SECONDS = 0.2
RESET = struct.pack("hh" if sys.platform == "win32" else "ii", 1, 0)

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
class _Link:
    """A client's connection, and the one to the server that was made for it."""

    channel: Channel
    number: int
    streams: tuple[_Stream, _Stream]
    awaits_server: bool = True

    @property
    def sockets(self) -> tuple[socket.socket, socket.socket]:
        """The client's, and the one to the server."""
        return self.streams[0].source, self.streams[0].sink


class Relay:
    """Relays both channels, on the thread that calls `run`.

    Args:
        listeners: bound sockets that clients connect to.
        servers: host and port that each channel is passed on to.
        note: is told of each piece and each end, after it was passed on; `t` is on the monotonic
            clock, counted from the start.
    """

    def __init__(
        self,
        listeners: Mapping[Channel, socket.socket],
        servers: Mapping[Channel, tuple[str, int]],
        note: Note,
    ) -> None:
        self._listeners = dict(listeners)
        self._servers = dict(servers)
        self._note = note
        self._start = time.monotonic()
        self._counts = dict.fromkeys(self._listeners, 0)
        self._links: set[_Link] = set()
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
        finally:
            for link in self._links:
                for each in link.sockets:
                    each.close()
            for listener in self._listeners.values():
                listener.close()
            self._selector.close()

    def turn(self, timeout: float) -> None:
        """Wait for at most `timeout` seconds, then pass on all that is there."""
        for key, mask in self._selector.select(timeout):
            if isinstance(key.data, _Link):
                if key.data in self._links:  # an event before this one may have ended it
                    self._serve(key.data, key.fileobj, mask)
            else:
                self._accept(key.data)

    def _accept(self, channel: Channel) -> None:
        with contextlib.suppress(OSError):  # gone before it was accepted
            client, _ = self._listeners[channel].accept()
            host, port = self._servers[channel]
            family, kind, protocol, _, address = socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM
            )[0]
            server = socket.socket(family, kind, protocol)
            for each in (client, server):
                each.setblocking(False)
                each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with contextlib.suppress(BlockingIOError):
                server.connect(address)
            streams = _Stream("c2s", client, server), _Stream("s2c", server, client)
            self._counts[channel] += 1
            link = _Link(channel, self._counts[channel], streams)
            self._links.add(link)
            self._selector.register(server, selectors.EVENT_WRITE, link)

    def _serve(self, link: _Link, ready: object, mask: int) -> None:
        try:
            if link.awaits_server:
                self._connected(link)
            for stream in link.streams:
                if stream.sink is ready and mask & selectors.EVENT_WRITE:
                    self._flush(link, stream)
                if stream.source is ready and mask & selectors.EVENT_READ:
                    self._receive(link, stream)
        except _BrokenError as end:
            self._abort(link, end.stream)
        else:
            self._await(link)

    def _connected(self, link: _Link) -> None:
        _, server = link.sockets
        if server.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise _BrokenError(None)  # no server: the client is let down, and nothing was said
        link.awaits_server = False
        self._note(Entry(self._now(), link.channel, link.number, event="open"))

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
            self._flush(link, stream)
            self._note(Entry(now, link.channel, link.number, stream.direction, data))
        else:
            stream.ended = True
            self._flush(link, stream)
            self._tell(link, stream, "eof", now)

    def _flush(self, link: _Link, stream: _Stream) -> None:
        try:
            while stream.pending:
                stream.pending = stream.pending[stream.sink.send(stream.pending) :]
            if stream.ended:
                stream.sink.shutdown(socket.SHUT_WR)
        except BlockingIOError:
            pass
        except OSError:  # who reads this direction is gone: the other one says how
            other = link.streams[0] if link.streams[1] is stream else link.streams[1]
            raise _BrokenError(other) from None

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

    def _abort(self, link: _Link, stream: _Stream | None) -> None:
        """Pass a reset on, by resetting both; one of `stream`'s source, if it had not ended."""
        if stream is not None and not stream.ended:
            self._tell(link, stream, "reset", self._now())
        for each in link.sockets:
            with contextlib.suppress(OSError):
                each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        self._close(link)

    def _close(self, link: _Link) -> None:
        self._links.discard(link)
        for each in link.sockets:
            self._watch(each, 0, link)
            each.close()

    def _tell(self, link: _Link, stream: _Stream, event: Event, now: float) -> None:
        self._note(Entry(now, link.channel, link.number, stream.direction, event=event))

    def _now(self) -> float:
        return time.monotonic() - self._start


class _BrokenError(Exception):
    """A socket of a link failed: that of the stream's source."""

    def __init__(self, stream: _Stream | None) -> None:
        self.stream = stream


def main(arguments: list[str]) -> None:
    """`python -m splatbus_conformance.relay FILE HOST IPC MSG HOST IPC MSG`: listen, pass on to.

    A process of its own, so that nobody's work delays what passes. Says `ready` or why not; ends
    when its standard input does.
    """
    file, host, *ports, server, server_ipc, server_msg = arguments
    # A user's Ctrl-C is for the process that started this one, which then ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    listeners: dict[Channel, socket.socket] = {}
    servers: dict[Channel, tuple[str, int]] = {
        "ipc": (server, int(server_ipc)),
        "msg": (server, int(server_msg)),
    }
    for channel, port in zip(servers, ports, strict=True):
        try:
            listeners[channel] = socket.create_server((host, int(port)))
        except OSError as error:
            print(f"cannot listen on {host}:{port}: {error.strerror}", flush=True)
            return
    with Path(file).open("w", buffering=1, encoding="utf-8", newline="\n") as recording:

        def note(entry: Entry) -> None:
            recording.write(to_line(entry) + "\n")

        relay = Relay(listeners, servers, note)

        def stop_at_end_of_input() -> None:
            sys.stdin.read()
            relay.stop()

        threading.Thread(target=stop_at_end_of_input, daemon=True).start()
        print("ready", flush=True)
        relay.run()


if __name__ == "__main__":
    main(sys.argv[1:])
