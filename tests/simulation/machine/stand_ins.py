"""What the modules of the pair find in place of `selectors`, `socket`, `time` and thread pools."""

from __future__ import annotations

import contextlib
import itertools
import logging
import selectors
import socket
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import splatbus_client.channel
import splatbus_client.reading
import splatbus_server.exchange
import splatbus_server.service
from splatbus_client.channel import Channel

from tests.simulation.machine.network import LOOPBACK, Network, Socket
from tests.simulation.machine.world import Node, World

NAP_SECONDS = 2.0


class SleepError(Exception):
    """A program has nothing to do; raised where it would block, before it has done anything.

    Attributes:
        seconds: for how long; None for until something happens.
    """

    def __init__(self, seconds: float | None) -> None:
        super().__init__()
        self.seconds = seconds


class Bell:
    """One end of a pair of sockets, by which one thread wakes another."""

    def __init__(self, owner: Node) -> None:
        self.owner = owner
        self.peer: Bell | None = None
        self.rings = 0

    is_writable = False

    @property
    def is_readable(self) -> bool:
        """Whether it was rung."""
        return self.rings > 0

    def setblocking(self, _: bool) -> None:
        """Does nothing: it never blocks."""

    def recv(self, most: int) -> bytes:
        """Hears the rings."""
        if not self.rings:
            raise BlockingIOError
        heard, self.rings = min(self.rings, most), max(0, self.rings - most)
        return b"!" * heard

    def send(self, data: bytes) -> int:
        """Rings."""
        assert self.peer is not None
        self.peer.rings += len(data)
        self.peer.owner.wake()
        return len(data)

    def close(self) -> None:
        """Does nothing."""


class Ready(NamedTuple):
    """What a selector returns: only what was registered with it is looked at."""

    fileobj: Any
    data: Any


class Selector:
    """Looks after sockets, listeners and bells."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._registered: dict[Any, tuple[int, Any]] = {}

    def register(self, fileobj: Any, events: int, data: Any = None) -> None:
        """As of `selectors`."""
        if fileobj in self._registered or not events:
            raise KeyError(f"{fileobj} is registered, or for nothing")
        self._registered[fileobj] = events, data

    def modify(self, fileobj: Any, events: int, data: Any = None) -> None:
        """As of `selectors`."""
        self.unregister(fileobj)
        self.register(fileobj, events, data)

    def unregister(self, fileobj: Any) -> None:
        """As of `selectors`."""
        del self._registered[fileobj]

    def get_map(self) -> dict[Any, Any]:
        """What is registered."""
        return self._registered

    def select(self, timeout: float | None = None) -> list[tuple[Ready, int]]:
        """What is ready, in any order.

        Raises:
            SleepError: nothing is, and there is time.
        """
        ready = [
            (Ready(fileobj, data), mask)
            for fileobj, (events, data) in self._registered.items()
            if (mask := mask_of(fileobj, events))
        ]
        if not ready and (timeout is None or timeout > 0):
            raise SleepError(timeout)
        if len(ready) > 1:
            self._world.random.shuffle(ready)
        return ready

    def close(self) -> None:
        """Does nothing."""


def take_turn(node: Node, hears: int, *channels: Channel) -> None:
    """A turn of the loop that looks after a client's channels.

    Args:
        node: the program.
        hears: what it looks out for at all: a mask of `selectors`.
        channels: of the reference.
    """
    now = node.clock()
    for channel in channels:
        channel.advance(now)
        socket: Any = channel.socket
        if socket is not None:
            socket.owner = node
            if mask := mask_of(socket, channel.interest() & hears):
                node.wake()
                channel.ready(mask, now)
    node.sleep(min(min(channel.deadline() for channel in channels) - now, NAP_SECONDS))


def mask_of(fileobj: Any, events: int) -> int:
    """Which of the events it is ready for."""
    mask = selectors.EVENT_READ if fileobj.is_readable else 0
    if events & selectors.EVENT_WRITE and fileobj.is_writable:
        mask |= selectors.EVENT_WRITE
    return events & mask


class Worker:
    """A pool of one thread, whose work takes virtual time and ends with its program."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._work: list[Callable[[], None]] = []

    def submit(self, work: Callable[..., None], *arguments: Any) -> None:
        """Has it done after what was submitted before."""
        self._work.append(partial(work, *arguments))
        random = self._node.world.random
        seconds = random.choice((0.0, 0.01, 0.5)) * random.random()
        self._node.world.after(seconds, self._do)

    def _do(self) -> None:
        if self._node.is_alive and self._work:
            self._work.pop(0)()

    def shutdown(self) -> None:
        """Waits for all that was submitted."""
        while self._work:
            self._work.pop(0)()


class _Defects(logging.Handler):
    """Takes what the server logs of defects of its own for broken."""

    def __init__(self, world: World) -> None:
        super().__init__(logging.ERROR)
        self._world = world

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if record.exc_info:
            text += ": " + logging.Formatter().formatException(record.exc_info)
        if record.exc_info and self._world.broken is None:
            with contextlib.suppress(Exception):
                self._world.look("no defect is caught", False, text)


class Host:
    """The machine that servers run on, one after the other.

    Attributes:
        network: of the machine.
        node: the program that runs now.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.node = Node(network.world)


@contextlib.contextmanager
def standing_in(host: Host, images: Callable[[Any], Any]) -> Iterator[None]:
    """Has the pair's modules use what stands in for the system, until the block ends.

    Args:
        host: of the servers.
        images: makes a client's mapped images of an init packet.
    """
    network, world = host.network, host.network.world

    def socketpair() -> tuple[Bell, Bell]:
        ends = Bell(host.node), Bell(host.node)
        ends[0].peer, ends[1].peer = ends[1], ends[0]
        return ends

    sockets = SimpleNamespace(
        **{
            **vars(socket),
            "socketpair": socketpair,
            "socket": lambda *_: Socket(network),
            "getaddrinfo": lambda host, port, **_: [(0, 0, 0, "", (LOOPBACK, port))],
        }
    )
    selecting = SimpleNamespace(**{**vars(selectors), "DefaultSelector": lambda: Selector(world)})
    cost = world.random.choice((0.0, 0.0, 0.00005, 0.0003))

    def monotonic() -> float:
        host.node.work(cost)
        return host.node.clock()

    work = itertools.count()

    def worked() -> float:
        return cost / 20 * next(work)  # a small part of what passes on a busy machine

    time = SimpleNamespace(monotonic=monotonic)
    defects = _Defects(world)
    loggers = [logging.getLogger(name) for name in ("splatbus_server", "splatbus_client")]
    levels = [logger.level for logger in loggers]
    with contextlib.ExitStack() as stack:
        for module, name, value in (
            (splatbus_server.service, "time", time),
            (splatbus_server.service, "clock", worked),
            (splatbus_server.service, "has_hung_up", lambda _: False),
            (splatbus_server.service, "selectors", selecting),
            (splatbus_server.service, "socket", sockets),
            (splatbus_server.service, "ThreadPoolExecutor", lambda *_: Worker(host.node)),
            (splatbus_server.exchange, "time", time),
            (splatbus_client.channel, "socket", sockets),
            (splatbus_client.reading, "HostImages", images),
            (splatbus_client.reading, "cuda", SimpleNamespace(usable=lambda: False)),
            (splatbus_client.reading, "LOOK_SECONDS", 1.0),
        ):
            stack.enter_context(mock.patch.object(module, name, value))
        for logger in loggers:
            logger.setLevel(logging.ERROR)
            logger.propagate = False
            logger.addHandler(defects)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.removeHandler(defects)
                logger.propagate = True
                logger.setLevel(level)
