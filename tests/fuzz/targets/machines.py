"""Targets: both sides' machines, which are fed bytes and moments, and act on what comes of them.

An input is a list of steps, parted by bytes that no text holds; the first letter of each says what
it is. So what a mutator does to bytes it does to the order of events, too.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from splatbus_client.events import Announced, IpcEvent, Lent, MessageEvent, MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol, NotOfferedError
from splatbus_server.connection import Connection, Refusal, Terms
from splatbus_server.session import CAPABILITIES, MESSAGE_CAPABILITIES, Session
from splatbus_wire.framing import PacketDecoder, encode_packet
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import (
    CameraPose,
    Frame,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    ObjectPose,
    Ping,
    Program,
    Request,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
    decode_from_client,
    decode_from_server_ipc,
)
from splatbus_wire.poses import IDENTITY

from tests.simulation.machine.memory import Memory, Store
from tests.simulation.machine.world import World
from tests.simulation.server import CAMERAS, SCENE

MARK = b"\xff"
"""Between two steps: UTF-8 has no such byte."""
PROGRAM = Program("fuzz", "1")
READERS = 2
PIECE = 7
TERMS = Terms(PROGRAM, {"ipc": CAPABILITIES, "msg": MESSAGE_CAPABILITIES})
HELLO = Hello(("1.1", "1.0"), PROGRAM, (*CAPABILITIES, *MESSAGE_CAPABILITIES))
QUESTIONS: tuple[Request, ...] = (
    GetViewportSize(),
    GetCameraPose(1),
    GetScene(),
    SetViewport(640, 480),
    Ping(1.0),
)
TOLD = (
    CameraPose(IDENTITY, 1.0, "tag"),
    ObjectPose("chair", IDENTITY, 2.0),
    SetTime(1.0),
    SubscribeTelemetry(None),
)
CHANNELS = [frozenset({"color"}), frozenset({"depth"}), frozenset({"color", "depth"})]


def steps(data: bytes) -> Iterable[tuple[str, bytes]]:
    """What is to be done, and with what."""
    for step in data.split(MARK):
        if step:
            yield chr(step[0]), step[1:]


def pieces(data: bytes) -> Iterable[bytes]:
    """As TCP may divide it."""
    return (data[at : at + PIECE] for at in range(0, len(data), PIECE))


class Stage:
    """A session with two connections on each channel, none of which is there before it is used."""

    def __init__(self) -> None:
        world = World(0)
        world.is_calm = True
        self.now = 0.0
        memory: Any = Memory(Store(world), "host_shm", 4, 2, READERS)
        self.session = Session(memory, SCENE, CAMERAS)
        self.exchange, self.readings = self.session.exchange, self.session.readings
        self._connections: dict[int, Connection] = {}

    def connection(self, number: int) -> Connection:
        """One of them; a new one where the former is over."""
        found = self._connections.get(number)
        if found is None or found.over:
            if found is not None:
                self.session.leave(found)
            found = Connection("ipc" if number < 2 else "msg", TERMS, self.now)
            self._connections[number] = found
            if found.channel == "ipc":
                self.session.join(found)
        return found

    def hear(self, connection: Connection, data: bytes) -> None:
        """What the service does with what came."""
        connection.receive(data, self.now)
        self.go_on()

    def go_on(self) -> None:
        """Handles what has come, passes on what is new, and does what takes long."""
        for connection in self._connections.values():
            while (event := connection.next_event(self.now)) is not None:
                if not isinstance(event, Refusal):
                    self.session.handle(connection, event, self.now)
        for _ in range(2):
            self.session.catch_up(self.now)
            chores, self.session.viewport.chores[:] = [*self.session.viewport.chores], []
            for chore in chores:
                chore()

    def publish(self) -> None:
        """What the renderer does."""
        view = self.exchange.next_view(0, True)
        if view is not None:
            self.exchange.publish(view, 0.0, lambda slot, wants: None)
            self.readings.give({"fps": 50.0, "stage": "a"}, self.now)

    def resize(self, width: int) -> None:
        """What a renderer may do at any time."""
        former = self.exchange.memory
        self.exchange.replace(former, former.successor(width, 2), is_own=True)

    def pass_time(self, seconds: float) -> None:
        """To a moment, at which all that is due happens."""
        self.now += seconds
        for connection in self._connections.values():
            if self.now >= connection.deadline:
                connection.expire(self.now)
        self.go_on()

    def look(self) -> None:
        """What is sent makes sense; nothing lent is written; nobody is remembered who is gone."""
        rings = [memory.ring for memory in (self.exchange.memory, *self.exchange.replaced)]
        for ring in rings:
            slots = [lease.slot for lease in ring.held.values()]
            assert ring.writing not in slots
            assert len(ring.seen) <= READERS
        held = [client for ring in rings for client in ring.held]
        assert len(held) == len(set(held))
        assert set(held) <= set(self.session.readers)
        for connection in self._connections.values():
            decoder = PacketDecoder()
            decoder.receive(bytes(connection.unsent))
            while (payload := decoder.next_packet()) is not None:
                parse_object(payload)
                if connection.channel == "ipc":
                    decode_from_server_ipc(payload)
            assert not decoder.incomplete
            connection.sent(len(connection.unsent), self.now)

    def leave(self) -> None:
        """Everyone goes: nothing is left of them."""
        for connection in self._connections.values():
            self.session.leave(connection)
        for _ in range(3):
            self.go_on()
        kept = [self.session.readers, self.session.control.sent, self.exchange.memory.ring.seen]
        kept += [self.exchange.replaced, self.session.told_busy, self.readings.subscribers]
        assert not any(kept), kept


def server(data: bytes) -> None:
    """A session that hears anything: a packet (a to d), bytes (A to D), an end (1 to 4)."""
    stage = Stage()
    for kind, rest in steps(data):
        if kind in "abcd":
            if rest:
                stage.hear(stage.connection("abcd".index(kind)), encode_packet(rest))
        elif kind in "ABCD":
            connection = stage.connection("ABCD".index(kind))
            for piece in pieces(rest):
                stage.hear(connection, piece)
        elif kind in "1234":
            stage.hear(stage.connection("1234".index(kind)), b"")
        elif kind == "p":
            stage.publish()
            stage.go_on()
        elif kind == "r":
            stage.resize(1 + len(rest) % 9)
            stage.go_on()
        elif kind == "t":
            stage.pass_time(float(1 + len(rest)))
        stage.look()
    stage.leave()


def client_of_images(data: bytes) -> None:
    """A client's IPC channel that hears anything, and does what is asked of it."""
    machine = IpcProtocol(HELLO, CHANNELS[len(data) % 3])
    lent: list[Frame] = []
    now = 0.0

    def take(events: Iterable[IpcEvent]) -> bool:
        for event in events:
            if isinstance(event, Announced):
                if len(data) % 5:
                    machine.opened(event.packet)
                    machine.look(1.0)
                else:
                    machine.open_failed(event.packet, "no")
            elif isinstance(event, Lent):
                lent.append(event.frame)
            elif isinstance(event, MustClose):
                return False
        return True

    for kind, rest in steps(data):
        goes_on = True
        if kind == "s" and rest:
            goes_on = take(machine.receive(encode_packet(rest), now))
        elif kind == "S":
            goes_on = all(take(machine.receive(piece, now)) for piece in pieces(rest))
        elif kind == "r" and lent:
            machine.release(lent.pop(0))
        elif kind == "c":
            for generation in sorted(machine.retired):
                machine.closed(generation)
        elif kind == "u" and machine.version is not None:
            machine.subscribe(CHANNELS[len(rest) % 3])
        elif kind == "t":
            now += float(len(rest))
            goes_on = take(machine.expire(now))
        _sent(machine.data_to_send(now), "ipc")
        if not goes_on:
            return


def client_of_messages(data: bytes) -> None:
    """A client's message channel that hears anything, while it asks and tells."""
    machine = MessageProtocol(HELLO)
    tickets: set[int] = set()
    now = 0.0

    def take(events: Iterable[MessageEvent]) -> bool:
        return not any(isinstance(event, MustClose) for event in events)

    for kind, rest in steps(data):
        goes_on = True
        if kind == "s" and rest:
            goes_on = take(machine.receive(encode_packet(rest), now))
        elif kind == "S":
            goes_on = all(take(machine.receive(piece, now)) for piece in pieces(rest))
        elif kind == "q":
            try:
                tickets.add(machine.ask(QUESTIONS[len(rest) % len(QUESTIONS)]))
            except NotOfferedError:
                assert machine.version is not None
        elif kind == "p":
            machine.tell(TOLD[len(rest) % len(TOLD)])
        elif kind == "t":
            now += float(len(rest))
            goes_on = take(machine.expire(now))
        _sent(machine.data_to_send(now), "msg")
        if not goes_on:
            return


def _sent(data: bytes, channel: Any) -> None:
    """What a client sends is what a server takes."""
    decoder = PacketDecoder()
    decoder.receive(data)
    while (payload := decoder.next_packet()) is not None:
        decode_from_client(payload, channel, said_hello=True)
    assert not decoder.incomplete
