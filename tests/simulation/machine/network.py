"""Sockets that stand in for those of TCP: in order, in pieces, late, full, lost.

As with TCP, a socket that is closed with something unread, or that something reaches afterwards,
resets the connection, and a reset discards what its receiver has not read.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from functools import partial

from tests.simulation.machine.world import Node, World

LOOPBACK = "127.0.0.1"


class Weather:
    """How the network is.

    Attributes:
        delay: longest time that a piece is on its way, seconds.
        capacity: how many bytes a direction holds that nobody has read.
        pieces: how likely a read or a write takes a part only.
    """

    def __init__(self, world: World) -> None:
        draw = world.random
        self.delay = draw.choice((0.0002, 0.002, 0.02, 0.2))
        self.capacity = draw.choice((60, 400, 1000, 65536, 65536))
        self.pieces = draw.choice((0.0, 0.2, 0.2, 0.7))


class Socket:
    """One end of a connection, which never blocks.

    Attributes:
        owner: woken when it may go on with the socket.
        peer: the other end, once there is one.
        arrived: what can be read.
        is_closed: by its owner.
        is_broken: the connection was reset.
        has_ended: the peer's end of stream has arrived.
        taken: how many bytes it took ever.
    """

    def __init__(self, network: Network, owner: Node | None = None) -> None:
        self.network = network
        self.world = network.world
        self.owner = owner
        self.peer: Socket | None = None
        self.port = 0
        self.arrived = bytearray()
        self.is_closed = self.is_broken = self.has_ended = False
        self._error: int | None = None  # of the attempt to connect; None while that goes on
        self._is_shut = self._is_clogged = False
        self._under_way = 0
        self._last_arrival = 0.0
        self.taken = 0
        self.capacity = network.weather.capacity

    # What its owner does with it

    def setblocking(self, _: bool) -> None:
        """Does nothing: it never blocks."""

    def setsockopt(self, *_: int) -> None:
        """Does nothing."""

    def getsockopt(self, *_: int) -> int:
        """The error of the attempt to connect, 0 if there is none."""
        return self._error or 0

    def getsockname(self) -> tuple[str, int]:
        """Its own address."""
        return LOOPBACK, self.port

    def getpeername(self) -> tuple[str, int]:
        """The address of the other end."""
        if self.peer is None:
            raise OSError(errno.ENOTCONN, "not connected")
        return LOOPBACK, self.peer.port

    def connect(self, address: tuple[str, int]) -> None:
        """Begins to connect."""
        self.world.after(self.network.delay(), partial(self.network.establish, self, address[1]))
        raise BlockingIOError

    def send(self, data: bytes | bytearray | memoryview) -> int:
        """Takes what there is room for."""
        self._check()
        if self._is_shut:
            raise BrokenPipeError(errno.EPIPE, "broken pipe")
        count = min(self.room, len(data))
        if count <= 0:
            raise BlockingIOError
        if self.world.chance(self.network.weather.pieces):
            count = self.world.random.randint(1, count)
        self._under_way += count
        self.taken += count
        self._carry(partial(self._arrive, bytes(data[:count])))
        return count

    def recv(self, most: int) -> bytes:
        """Hands out what has arrived, or a part of it."""
        self._check()
        if not self.arrived:
            if self.has_ended:
                return b""
            raise BlockingIOError
        count = min(most, len(self.arrived))
        if self.world.chance(self.network.weather.pieces):
            count = self.world.random.randint(1, count)
        data = bytes(self.arrived[:count])
        peer = self.peer
        assert peer is not None
        was_full = peer.room <= 0
        del self.arrived[:count]
        if was_full:
            _wake(peer)
        return data

    def shutdown(self, _: int) -> None:
        """Ends its own direction."""
        self._check()
        if not self._is_shut:
            self._is_shut = True
            self._carry(self._end_stream)

    def close(self) -> None:
        """Ends the connection."""
        if self.is_closed:
            return
        self.is_closed = True
        self.network.sockets.pop(self, None)
        if self.peer is None or self.is_broken:
            return
        if self.arrived:
            self.arrived.clear()
            self._reset_peer()
        elif not self._is_shut:
            self._is_shut = True
            self._carry(self._end_stream)

    # What a selector asks

    @property
    def is_readable(self) -> bool:
        """Whether a read would return, or raise."""
        return bool(self.arrived) or self.has_ended or self.is_broken

    @property
    def is_writable(self) -> bool:
        """Whether a write would take something, or raise."""
        if self.peer is None:
            return self._error is not None
        return self.is_broken or self.room > 0

    @property
    def room(self) -> int:
        """How many bytes a write takes."""
        if self._is_clogged or self.peer is None:
            return 0
        return self.capacity - self._under_way - len(self.peer.arrived)

    # What happens to it

    def clog(self, seconds: float) -> None:
        """Lets it take nothing for a time."""
        self._is_clogged = True
        self.world.after(seconds, self.unclog)

    def unclog(self) -> None:
        """Lets it take something again."""
        self._is_clogged = False
        _wake(self)

    def fail(self) -> None:
        """Is reset; what was not read is lost."""
        if not self.is_closed and not self.is_broken:
            self.is_broken = True
            self.arrived.clear()
            _wake(self)

    def refuse(self, error: int) -> None:
        """Ends the attempt to connect."""
        self._error = error
        _wake(self)

    def join(self, peer: Socket, port: int) -> None:
        """Is connected."""
        self._error, self.peer, self.port = 0, peer, port
        self.network.sockets[self] = None
        _wake(self)

    def _carry(self, act: Callable[[], None]) -> None:
        moment = max(self._last_arrival, self.world.now + self.network.delay())
        self._last_arrival = moment
        self.world.at(moment, act)

    def _arrive(self, data: bytes) -> None:
        peer = self.peer
        assert peer is not None
        self._under_way -= len(data)
        if peer.is_closed:
            self.fail()
        elif not peer.is_broken:
            peer.arrived += data
            _wake(peer)

    def _end_stream(self) -> None:
        assert self.peer is not None
        self.peer.has_ended = True
        _wake(self.peer)

    def _reset_peer(self) -> None:
        assert self.peer is not None
        self.world.after(self.network.delay(), self.peer.fail)

    def _check(self) -> None:
        if self.is_closed:
            raise OSError(errno.EBADF, "closed")
        if self.is_broken or self.peer is None:
            raise ConnectionResetError(errno.ECONNRESET, "connection reset by peer")


class Listener:
    """A port that clients can connect to."""

    def __init__(self, network: Network, port: int, owner: Node) -> None:
        self.network, self.port, self.owner = network, port, owner
        self.waiting: list[Socket] = []
        network.listeners[port] = self

    @property
    def is_readable(self) -> bool:
        """Whether a client waits."""
        return bool(self.waiting)

    @property
    def is_writable(self) -> bool:
        """Never."""
        return False

    def accept(self) -> tuple[Socket, tuple[str, int]]:
        """The next client."""
        if not self.waiting:
            raise BlockingIOError
        if self.network.world.chance(0.01):
            raise OSError(errno.EMFILE, "too many open files")
        accepted = self.waiting.pop(0)
        accepted.owner = self.owner
        return accepted, accepted.getpeername()

    def close(self) -> None:
        """Lets nobody connect any more."""
        if self.network.listeners.get(self.port) is self:
            del self.network.listeners[self.port]
        for each in self.waiting:
            each.close()


class Network:
    """All sockets of a machine.

    Attributes:
        sockets: those that are connected, in order.
        listeners: by port.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.weather = Weather(world)
        self.sockets: dict[Socket, None] = {}
        self.listeners: dict[int, Listener] = {}
        self._ports = iter(range(40000, 10**9))

    def delay(self) -> float:
        """Seconds that something is on its way."""
        longest = 0.0005 if self.world.is_calm else self.weather.delay
        return self.world.random.random() * longest

    def establish(self, client: Socket, port: int) -> None:
        """Connects a socket, or not."""
        listener = self.listeners.get(port)
        if client.is_closed:
            return
        if listener is None:
            client.refuse(errno.ECONNREFUSED)
            return
        served = Socket(self)
        client.join(served, next(self._ports))
        served.join(client, port)
        listener.waiting.append(served)
        listener.owner.wake()

    def reset(self, socket: Socket) -> None:
        """Loses a connection, with all that is under way; its ends learn it one after the other."""
        for end in (socket, socket.peer):
            assert end is not None
            self.world.after(self.delay(), end.fail)

    def calm(self) -> None:
        """Lets nothing be clogged any more."""
        for socket in [*self.sockets]:
            socket.capacity = 1 << 16
            socket.unclog()


def _wake(socket: Socket) -> None:
    if socket.owner is not None and not socket.is_closed:
        socket.owner.wake()
