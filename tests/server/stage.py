"""A session with its clients and its renderer, without sockets, threads or a clock."""

from __future__ import annotations

from typing import Any

from splatbus_server.connection import Connection, Refusal, Terms
from splatbus_server.control import Poses
from splatbus_server.exchange import Exchange
from splatbus_server.limits import DEFAULT, Limits
from splatbus_server.memory import Memory
from splatbus_server.session import CAPABILITIES, MESSAGE_CAPABILITIES, Session
from splatbus_server.statistics import Statistics
from splatbus_server.telemetry import Readings
from splatbus_server.view import View, field_of_view
from splatbus_wire.messages import Placement, Program, Scene, SceneObject
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.semantics import Semantics

from tests.peers.raw_client import hello, packet, packets

CAMERAS = [Pose((float(index), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for index in range(3)]
OBJECTS = {name: Placement(name, IDENTITY) for name in ("default", "chair")}
SCENE = Scene(
    tuple(SceneObject(name, name.title(), 7) for name in OBJECTS), (0.0, 2.0), 3, (0.0, 0.0, 0.0)
)
TERMS = Terms(Program("s", "1"), {"ipc": CAPABILITIES, "msg": MESSAGE_CAPABILITIES})
READERS = 2


class Stage:
    """A session and its renderer, without sockets and threads."""

    def __init__(self, memory: Memory | None = None, limits: Limits = DEFAULT) -> None:
        self.memory = memory or Memory(4, 2, READERS, Semantics())
        self.statistics = Statistics()
        self.readings = Readings(self.statistics)
        self.now = 0.0
        poses = Poses(IDENTITY, OBJECTS)
        self.exchange = Exchange(self.memory, field_of_view(4, 2), poses, self.statistics)
        self.session = Session(
            self.exchange, CAMERAS, READERS, self.statistics, SCENE, self.readings, limits
        )

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

    def connect(self, *capabilities: str, **other: Any) -> Client:
        client = Client(self, Connection("ipc", TERMS, self.now))
        client.say(hello(*(capabilities or CAPABILITIES), **other))
        return client

    def steerer(self, *capabilities: str) -> Client:
        """A client of 1.1 on the message channel, with all capabilities if none is named."""
        client = Client(self, Connection("msg", TERMS, self.now))
        client.say(hello(*(capabilities or MESSAGE_CAPABILITIES)))
        client.hear()
        return client

    def reader(self, *capabilities: str) -> Client:
        """A client that has opened the memory."""
        client = self.connect(*capabilities)
        client.say({"type": "opened", "generation": self.exchange.memory.generation})
        client.hear()
        return client

    def view(self) -> View | None:
        return self.exchange.next_view(0, False)

    def publish(self, view: View | None = None) -> None:
        view = view or self.view()
        assert view is not None
        self.exchange.publish(view, 0.0, lambda slot, wants: None)
        self.catch_up()

    def resize(self, width: int, height: int) -> Memory:
        former = self.exchange.memory
        assert self.exchange.replace(former, former.successor(width, height), is_own=True)
        self.catch_up()
        return self.exchange.memory


class Client:
    def __init__(self, stage: Stage, connection: Connection) -> None:
        self.stage = stage
        self.connection = connection

    def say(self, *messages: Any) -> list[Refusal]:
        """Sends; returns what was refused."""
        refused = []
        now = self.stage.now
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

    def frame(self) -> dict[str, Any]:
        (frame,) = self.hear()
        assert frame["type"] == "frame"
        return frame

    def release(self, frame: dict[str, Any]) -> list[Refusal]:
        return self.say({"type": "release", "generation": frame["generation"], "seq": frame["seq"]})

    def leave(self) -> None:
        self.stage.session.leave(self.connection)
        self.stage.catch_up()
