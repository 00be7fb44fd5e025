"""A server of the simulation: the reference's service and session, and a renderer that paints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from splatbus_server.connection import Connection, Refusal, Terms
from splatbus_server.service import Service
from splatbus_server.session import CAPABILITIES, MESSAGE_CAPABILITIES, Session
from splatbus_server.view import View
from splatbus_wire.messages import (
    CameraPose,
    ClientMessage,
    ObjectPose,
    PointCloudPose,
    Program,
    SetTime,
)

from tests.server.stage import CAMERAS, SCENE
from tests.simulation.machine.memory import HALVES, Memory, Store
from tests.simulation.machine.network import Listener
from tests.simulation.machine.stand_ins import Host, SleepError
from tests.simulation.machine.world import Node, World

IPC_PORT, MESSAGE_PORT = 6001, 6000


@dataclass(frozen=True)
class Setting:
    """How a server is started.

    Attributes:
        kind: of its memory.
        readers: how many clients may hold an image at a time.
        pause: longest time between two looks of its renderer, seconds.
    """

    kind: str
    readers: int
    pause: float


@dataclass(frozen=True)
class Picture:
    """An image as it was painted.

    Attributes:
        number: in every element.
        view: what it shows.
        slot: where.
    """

    number: int
    view: View
    slot: int


class WatchedSession(Session):
    """A session whose steering is looked at from outside.

    Attributes:
        cameras: where the newest valid pose of each says that the camera is, None if it sent
            another valid message only; the connections in the order of their first.
    """

    world: World
    cameras: dict[Connection, float | None]

    def handle(self, connection: Connection, message: ClientMessage, now: float) -> Refusal | None:
        """As the session does; [POS-11] says who has control."""
        refusal = super().handle(connection, message, now)
        self.world.note(
            "the server hears", type(message).__name__, "" if refusal is None else refusal
        )
        if isinstance(message, (CameraPose, PointCloudPose, ObjectPose, SetTime)):
            cameras = self.cameras
            if refusal is None or refusal.code == "busy":
                cameras.setdefault(connection, None)
                if isinstance(message, CameraPose):
                    cameras[connection] = message.pose.position[0]
                is_first = next(iter(cameras)) is connection
                self.world.look("control is with the first", is_first == (refusal is None), refusal)
        return refusal

    def leave(self, connection: Connection) -> None:
        """As the session does."""
        super().leave(connection)
        self.cameras.pop(connection, None)


class Server(Node):
    """A server from its start to its end.

    Attributes:
        pictures: what was published, by generation and `seq`.
        painting: it is in the middle of an image.
        contents: the scene itself changes with this number.
        renderer_is_busy: its thread paints, or makes memory.
    """

    def __init__(self, host: Host, store: Store, setting: Setting) -> None:
        super().__init__(host.network.world)
        self.store, self.setting = store, setting
        self.pictures: dict[tuple[int, int], Picture] = {}
        self.painting: tuple[Memory, int] | None = None
        self.contents = 0
        self.looks: list[Callable[[Server, bool], None]] = []
        self._shown_contents = 0
        self._numbers = 0
        self.renderer_is_busy = False
        self._memory_before = len(store.made)
        host.node = self
        memory = Memory(store, setting.kind, 4, 2, setting.readers)
        self.session = WatchedSession(memory, SCENE, CAMERAS)
        self.session.world, self.session.cameras = self.world, {}
        self.exchange = self.session.exchange
        ipc = tuple(setting.kind if name == "host_shm" else name for name in CAPABILITIES)
        capabilities: dict[Any, tuple[str, ...]] = {"ipc": ipc, "msg": MESSAGE_CAPABILITIES}
        listeners: dict[Any, Any] = {
            "ipc": Listener(host.network, IPC_PORT, self),
            "msg": Listener(host.network, MESSAGE_PORT, self),
        }
        terms = Terms(Program("server", "1"), capabilities)
        self.service = Service(listeners, self.session, terms)
        self.wake()
        self._render_soon()

    @property
    def memory(self) -> Memory:
        """Where images are published now."""
        memory = self.exchange.memory
        assert isinstance(memory, Memory)
        return memory

    @property
    def own_memory(self) -> list[Memory]:
        """All that it has and has not freed."""
        made = [*self.store.made.values()][self._memory_before :]
        return [memory for memory in made if not memory.is_freed]

    def turn(self) -> None:
        """A turn of the service; then it is looked at."""
        try:
            self.service._turn()
        except SleepError as nothing:
            if nothing.seconds is not None:
                self.sleep(nothing.seconds)
            self.look(is_idle=True)
        else:
            self.wake()
            self.look()

    def look(self, *, is_idle: bool = False) -> None:
        """Has it looked at; when it is idle, nothing has changed but the time."""
        for watch in self.looks:
            watch(self, is_idle)

    def end(self, kindly: bool) -> None:
        """Ends; a server that is not killed frees its memory, as `Bus.close` does."""
        self.world.note("the server ends" if kindly else "the server is killed")
        if kindly:
            self.service.stop()
        else:
            self.is_alive = False
            self.service.stop()
        self.service.run()  # which closes every socket
        self.is_alive = False
        if kindly:
            self.session.viewport.close()
            for memory in (*self.exchange.replaced, self.exchange.memory):
                memory.close()
            left = self.own_memory
            self.world.look("a server that ends frees all memory", not left, left)

    # The render loop

    def _render_soon(self) -> None:
        pause = 0.6 if self.world.is_calm else self.setting.pause
        self.world.after(self.world.random.random() * pause, self._render)

    def _render(self) -> None:
        if not self.is_alive:
            return
        if not self.renderer_is_busy:
            changed = self.contents != self._shown_contents
            view = self.exchange.next_view(0, changed)
            if view is not None:
                contents = self.contents
                self.renderer_is_busy = True
                if self._paint(view):
                    self._shown_contents = contents
                self.renderer_is_busy = False
        self._render_soon()

    def _paint(self, view: View) -> bool:
        """As `Bus.publish` does; whether the image came to be the newest."""
        memory = self.memory
        self._numbers += 1
        number, former = self._numbers, self.exchange.newest
        fails = self.world.chance(0.01)

        def fill(slot: int, wants: Any) -> None:
            self.painting = memory, slot
            for half in range(HALVES):
                if half:
                    self.world.run(self.world.now + self.world.random.random() * 0.02)
                    if fails:
                        raise OSError("the renderer fails")
                self.look()
                memory.write(slot, wants, number, half)

        has_news = True
        try:
            has_news = self.exchange.publish(view, 0.0, fill)
        except OSError:
            self.world.note("an image fails")
        finally:
            self.painting = None
            if has_news and self.is_alive:
                self.service.ring()
        newest = self.exchange.newest
        is_newest = newest is not None and newest is not former and newest.view is view
        if newest is not None and is_newest:
            key = newest.memory.generation, newest.seq
            self.pictures[key] = Picture(number, view, newest.slot)
            self.world.note("image", number, "is", key, "in slot", newest.slot)
        return is_newest

    def resize(self, width: int, height: int) -> None:
        """As `Bus.resize` does, in the render loop."""
        if self.renderer_is_busy:
            return
        self.renderer_is_busy = True
        while self.is_alive:
            former = self.memory
            try:
                memory = former.successor(width, height)
            except OSError:
                break
            self.world.run(self.world.now + self.world.random.random() * 0.01)
            if self.exchange.replace(former, memory, is_own=True):
                self.world.note("the renderer resizes: generation", memory.generation)
                self.service.ring()
                break
            memory.close()
        self.renderer_is_busy = False
