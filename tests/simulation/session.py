"""A session: some seconds in which everything goes wrong that may, then a calm one to look at."""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import Any

from splatbus_wire.messages import Hello

from tests.simulation import calm
from tests.simulation.clients import CHANNELS, Client
from tests.simulation.clients import Setting as ClientSetting
from tests.simulation.invariants import Watch
from tests.simulation.machine.memory import Images, Store
from tests.simulation.machine.network import Network
from tests.simulation.machine.stand_ins import Host, standing_in
from tests.simulation.machine.world import BrokenError, World
from tests.simulation.server import Server
from tests.simulation.server import Setting as ServerSetting
from tests.simulation.visitors import PROGRAM, RUDE, Pipelining, Rude, Visitor


class Session:
    """Everyone who takes part, and what happens to them.

    Attributes:
        server: the one that runs now, or ran last.
        clients: the reference's.
        visitors: all others.
    """

    def __init__(self, world: World) -> None:
        draw = world.random
        self.world = world
        self.network = Network(world)
        self.host = Host(self.network)
        self.store = Store(world)
        self.setting = ServerSetting(
            kind=draw.choice(("host_shm", "host_shm", "cuda_ipc")),
            readers=draw.randint(1, 4),
            pause=draw.choice((0.03, 0.1, 0.4)),
        )

    def begin(self) -> None:
        """Starts the server and everybody else."""
        draw, tickets = self.world.random, count(10)
        self.clients: list[Client] = []
        self.visitors: list[Visitor] = []
        self.start_server()
        for number in range(draw.randint(1, 4)):
            self.clients.append(Client(number, self.store, self._draw_client(), tickets))
        capabilities = (self.setting.kind, "frames", "reinit", "viewport", "ping")
        hello = Hello(("1.1",), PROGRAM, capabilities)
        if draw.random() < 0.3:
            self.visitors.append(Pipelining(self.network, hello))
        if draw.random() < 0.3:
            self.visitors.append(Pipelining(self.network, None))
        for _ in range(draw.choice((0, 1, 1, 2))):
            self.visitors.append(Rude(self.network, draw.choice(RUDE), hello))

    def _draw_client(self) -> ClientSetting:
        draw = self.world.random
        extra = [name for name in ("frames", "reinit", "subscribe") if draw.random() < 0.85]
        return ClientSetting(
            capabilities=(self.setting.kind, *extra),
            channels=draw.choice(CHANNELS),
            patience=draw.choice((0.0, 0.02, 0.02, 1.0, 12.0)),
            pause=draw.choice((0.2, 0.5, 1.5)),
        )

    def start_server(self) -> None:
        """Starts a server, where there is none."""
        self.server = Server(self.host, self.store, self.setting)
        self.server.looks.append(Watch(lambda: self.clients))

    # What goes wrong

    def storm(self) -> None:
        """Everyone does what they like, and much goes wrong."""
        draw, world = self.world.random, self.world
        end = world.now + min(0.5 + draw.expovariate(1 / 1.5), 20.0)
        for client in self.clients:
            self._again_and_again(partial(self._use, client), client.setting.pause, end)
        for visitor in self.visitors:
            self._again_and_again(visitor.act, 0.5, end)
        self._again_and_again(self._change, draw.choice((0.2, 0.5)), end)
        self._again_and_again(self._harm, draw.choice((0.2, 0.5, 2.0)), end)
        world.run(end)

    def _again_and_again(self, act: Callable[[], None], pause: float, end: float) -> None:
        def once() -> None:
            if self.world.now < end:
                with contextlib.suppress(OSError):  # a visitor's socket that is gone
                    act()
                self.world.after(self.world.random.expovariate(1 / pause), once)

        self.world.after(self.world.random.expovariate(1 / pause), once)

    def _use(self, client: Client) -> None:
        if client.is_running:
            client.act()

    def _change(self) -> None:
        """The renderer does something of its own accord."""
        self.server.contents += 1
        if self.world.random.random() < 0.08 and self.server.is_alive:
            self.server.resize(self.world.random.randint(1, 9), 2)

    def _harm(self) -> None:
        draw = self.world.random
        kind = draw.choice(HARM)
        self.world.note("HARM", kind)
        HARMS[kind](self)

    def _reset(self) -> None:
        if self.network.sockets:
            self.network.reset(self.world.random.choice([*self.network.sockets]))

    def _clog(self) -> None:
        if self.network.sockets:
            socket = self.world.random.choice([*self.network.sockets])
            socket.clog(self.world.random.choice((0.1, 1.0, 7.0)))

    def _anyone(self) -> Any:
        return self.world.random.choice([self.server, self.server, *self.clients])

    def _seconds(self) -> float:
        return self.world.random.choice((0.05, 0.5, 3.0, 6.0, 11.0)) * self.world.random.random()

    def _restart(self, is_kind: bool) -> None:
        if self.server.is_alive:
            self.server.end(is_kind and not self.server.renderer_is_busy)
            self.world.after(self.world.random.random() * 2.0, self.start_server)

    def _vanish(self) -> None:
        client = self.world.random.choice(self.clients)
        if client.is_running:
            self.world.note(client.name, "ends without a word")
            client.stop()
            self.world.after(self.world.random.random() * 2.0, client.start)


HARMS: dict[str, Callable[[Session], None]] = {
    "reset": Session._reset,
    "clog": Session._clog,
    "jump": lambda session: session._anyone().jump(session._seconds()),
    "pause": lambda session: session._anyone().pause(session._seconds()),
    "vanish": Session._vanish,
    "restart": lambda session: session._restart(True),
    "kill": lambda session: session._restart(False),
}
HARM = [*HARMS, "reset", "clog", "jump", "pause", "vanish"]


def play(seed: int, tell: Callable[[str], None] | None = None) -> World:
    """Plays the session of a seed.

    Raises:
        BrokenError: an invariant does not hold.
    """
    world = World(seed, tell)
    session = Session(world)
    with standing_in(session.host, partial(Images, session.store)):
        try:
            session.begin()
            session.storm()
            calm.settle(session)
            calm.serve(session)
            calm.leave(session)
        except BrokenError:
            raise
        except Exception as error:
            raise BrokenError("nobody fails", "".join(traceback.format_exception(error))) from error
    return world
