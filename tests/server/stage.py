"""A session with its clients and its renderer, without sockets, threads, a clock or memory."""

from __future__ import annotations

from typing import Any

from splatbus_server.connection import Connection, Refusal, Terms
from splatbus_server.limits import DEFAULT, Limits
from splatbus_server.session import CAPABILITIES, MESSAGE_CAPABILITIES, Session
from splatbus_server.view import View
from splatbus_wire.messages import Channel, Program, Scene, SceneObject
from splatbus_wire.poses import Pose

from tests.peers.raw_client import hello, packet, packets
from tests.simulation.machine.memory import Memory, Store
from tests.simulation.machine.world import World

CAMERAS = [Pose((float(index), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for index in range(3)]
SCENE = Scene(
    tuple(SceneObject(name, name.title(), 7) for name in ("default", "chair")),
    (0.0, 2.0),
    len(CAMERAS),
    (0.0, 0.0, 0.0),
)
READERS = 2


class Stage:
    """A session, who takes part in it, and the moment that it is."""

    def __init__(self, kind: str = "host_shm", limits: Limits = DEFAULT) -> None:
        self.world = World(0)
        self.world.is_calm = True
        self.memory: Any = Memory(Store(self.world), kind, 4, 2, READERS)
        self.capabilities = tuple(kind if name == "host_shm" else name for name in CAPABILITIES)
        self.now = 0.0
        self.session = Session(self.memory, SCENE, CAMERAS, None, limits)
        self.exchange, self.statistics = self.session.exchange, self.session.statistics

    def catch_up(self) -> None:
        """What the service does after each turn; chores are for `do_chores`."""
        self.session.catch_up(self.now)

    def do_chores(self) -> int:
        """What the service does in another thread; returns how many there were."""
        chores, self.session.viewport.chores = self.session.viewport.chores, []
        for chore in chores:
            chore()
        self.catch_up()
        return len(chores)

    def wait(self, seconds: float) -> None:
        """Lets time pass, to the next deadline and on from there."""
        end = self.now + seconds
        while (due := self.session.deadline) <= end:
            assert due >= self.now, "a deadline in the past would never be met"
            self.now = due
            self.catch_up()
        self.now = end

    def arrive(self, channel: Channel = "ipc", token: str | None = None) -> Client:
        """Somebody who has said nothing yet, as the service takes it."""
        capabilities = {"ipc": self.capabilities, "msg": MESSAGE_CAPABILITIES}
        terms = Terms(Program("s", "1"), capabilities, token)
        client = Client(self, Connection(channel, terms, self.now))
        if channel == "ipc" and token is None:
            self.session.join(client.connection)
        self.catch_up()
        return client

    def steerer(self) -> Client:
        """A client of 1.1 on the message channel."""
        client = self.arrive("msg")
        assert client.ask(hello(*MESSAGE_CAPABILITIES))["type"] == "welcome"
        return client

    def reader(self, *capabilities: str) -> Client:
        """A client that has opened the memory."""
        client = self.arrive()
        client.say(hello(*(capabilities or self.capabilities)))
        client.say({"type": "opened", "generation": self.exchange.memory.generation})
        client.hear()
        return client

    def view(self, *, contents_changed: bool = False) -> View | None:
        return self.exchange.next_view(0, contents_changed)

    def publish(self, view: View | None = None) -> None:
        view = view or self.view()
        assert view is not None
        self.exchange.publish(view, 0.0, lambda slot, wants: None)
        self.catch_up()

    def resize(self, width: int, height: int) -> None:
        """As the renderer does."""
        former = self.exchange.memory
        assert self.exchange.replace(former, former.successor(width, height), is_own=True)
        self.catch_up()

    @property
    def size(self) -> tuple[int, int]:
        """Of the images."""
        return self.exchange.memory.width, self.exchange.memory.height


class Client:
    def __init__(self, stage: Stage, connection: Connection) -> None:
        self.stage = stage
        self.connection = connection

    def say(self, *messages: Any) -> list[Refusal]:
        """Sends; returns what was refused."""
        refused, now = [], self.stage.now
        if messages:
            self.connection.receive(b"".join(map(packet, messages)), now)
        while (event := self.connection.next_event(now)) is not None:
            if not isinstance(event, Refusal):
                event = self.stage.session.handle(self.connection, event, now)
            if event is not None:
                refused.append(event)
        self.stage.catch_up()
        return refused

    def hear(self) -> list[dict[str, Any]]:
        data = bytes(self.connection.unsent)
        self.connection.sent(len(data), self.stage.now)
        return packets(data)

    def ask(self, message: Any) -> dict[str, Any]:
        """Sends; returns the one message that comes back."""
        self.say(message)
        (answer,) = self.hear()
        return answer

    def resize(self, width: int = 8, height: int = 6) -> dict[str, Any]:
        """Asks for another size, waits for the memory, and returns the reply."""
        self.say({"type": "set_viewport", "width": width, "height": height, "id": 12})
        self.stage.do_chores()
        (reply,) = self.hear()
        return reply

    def answer(self, opened: int, *closed: int) -> None:
        """Says which generation it has opened, and which it has closed."""
        self.say({"type": "opened", "generation": opened})
        self.say(*({"type": "closed", "generation": each} for each in closed))

    def leave(self) -> None:
        self.stage.session.leave(self.connection)
        self.stage.catch_up()
