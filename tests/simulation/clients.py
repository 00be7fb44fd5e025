"""Clients of the simulation: the reference's channels, reading and steering, and who uses them."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import Any, TypeVar

from splatbus_client.channel import Channel
from splatbus_client.events import Ignored, IpcEvent, Lent, MessageEvent, MustClose, ServerError
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.lease import Glimpse
from splatbus_client.message_protocol import MessageProtocol
from splatbus_client.reading import Loan, Reading
from splatbus_client.steering import ServerRefusedError, Steering
from splatbus_wire.init_packet import InitPacket
from splatbus_wire.messages import (
    CameraPose,
    ErrorMessage,
    Frame,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Intrinsics,
    ObjectPose,
    Ping,
    Program,
    Request,
    SetTime,
    SetViewport,
    ViewportSize,
)
from splatbus_wire.poses import IDENTITY, Pose

from tests.simulation.machine.memory import HALVES, LEGACY, Store
from tests.simulation.machine.network import Socket
from tests.simulation.machine.stand_ins import take_turn
from tests.simulation.machine.world import Node
from tests.simulation.server import CAMERAS, IPC_PORT, MESSAGE_PORT, Server

UNANSWERED = 4
"""How many questions are asked at a time."""
ORDINARY = frozenset({"busy", "unsupported", "unknown_object"})
"""The errors that a client gets that does nothing wrong."""
TURNED_AWAY = frozenset({"too_many_clients"})
Machine = TypeVar("Machine", IpcProtocol, MessageProtocol)
CHANNELS = [frozenset({"color"}), frozenset({"depth"}), frozenset({"color", "depth"})]


@dataclass(frozen=True)
class Setting:
    """What a client is like.

    Attributes:
        capabilities: of its IPC channel.
        channels: that it reads at first.
        patience: longest time that it reads an image for, seconds.
        pause: mean time between two things that it does, seconds.
    """

    capabilities: tuple[str, ...]
    channels: frozenset[str]
    patience: float
    pause: float


class WatchedReading(Reading):
    """A reading that looks at what it is told."""

    def __init__(self, client: Client, hello: Hello, channels: frozenset[str]) -> None:
        super().__init__(hello, channels)
        self._client = client
        self._seq = -1

    def begin(self) -> IpcProtocol:
        """Numbers begin again."""
        self._seq = -1
        return self._client.watched(super().begin())

    def open_memory(self, packet: InitPacket) -> None:
        """Looks whether the memory is still there [OPN-8]."""
        client = self._client
        memory = client.store.find(packet)
        client.look(
            "memory is there while it is announced",
            not (memory.is_freed and client.is_served(client.ipc.socket)),
            memory.name,
        )
        super().open_memory(packet)

    def handle(self, event: IpcEvent) -> None:
        """Compares a frame with the image that was painted."""
        if isinstance(event, Lent):
            self._look_at(event.frame, event.channels)
        elif isinstance(event, ServerError):
            self._client.hear(event.error)
        super().handle(event)

    def _look_at(self, frame: Frame, channels: frozenset[str]) -> None:
        look, socket = self._client.look, self._client.ipc.socket
        look("seq grows", frame.seq > self._seq, frame.seq, "after", self._seq)
        self._seq = frame.seq
        picture = self._client.server_of(socket).pictures.get((frame.generation, frame.seq))
        look("a frame names an image", picture is not None, frame.generation, frame.seq)
        assert picture is not None
        poses, camera = picture.view.poses, frame.camera
        look(
            "a frame tells the image's camera",
            (frame.slot, camera.width, camera.height, camera.pose.position)
            == (picture.slot, picture.view.width, picture.view.height, poses.camera.position)
            and camera.tag in (None, poses.tag),
            frame,
        )
        look("an image holds what is read", channels <= picture.view.wants, channels)
        told = f"{frame.generation}/{frame.seq} in slot {frame.slot}"
        self._client.world.note(self._client.name, "is lent", told)


class WatchedSteering(Steering):
    """A steering that looks at what it is told."""

    def __init__(self, client: Client, hello: Hello) -> None:
        super().__init__(hello)
        self._client = client

    def begin(self) -> MessageProtocol:
        """Has what comes watched."""
        return self._client.watched(super().begin())

    def handle(self, event: MessageEvent) -> None:
        """Looks at the errors."""
        super().handle(event)
        if isinstance(event, ServerError):
            self._client.hear(event.error)


class Client(Node):
    """A program with a session, from its start to its end; it can be started again.

    Attributes:
        seen: the number of the image that was read last, and of which server.
        read: the channels that it read of that image.
        wants: those that it wants.
        sent: where it has put the camera.
        has_lens: it has sent intrinsics, which are refused where the size has changed.
        is_turned_away: the server said that it takes it not.
    """

    def __init__(self, number: int, store: Store, setting: Setting, tickets: count[int]) -> None:
        super().__init__(store.world)
        self.name, self.store, self.setting = f"client {number}", store, setting
        self.tickets = tickets
        self.life = 0
        self.is_running = False
        self.start()

    def start(self) -> None:
        """Starts, as a new process."""
        program = Program(self.name, "1")
        hello = Hello(("1.1", "1.0"), program, self.setting.capabilities)
        self.life += 1
        self.is_running = True
        self.seen: tuple[Server | None, int] = (None, 0)
        self.read: frozenset[str] = frozenset()
        self.wants = self.setting.channels
        self.sent: float | None = None
        self.has_lens = False
        self.is_turned_away = False
        self.questions: list[Future[Any]] = []
        self.held: tuple[Loan, Socket | None] | None = None
        self.reading = WatchedReading(self, hello, self.setting.channels)
        self.steering = WatchedSteering(self, hello)
        self.ipc = Channel("IPC", "127.0.0.1", IPC_PORT, self.reading)
        self.message = Channel("message", "127.0.0.1", MESSAGE_PORT, self.steering)
        self.wake()

    def stop(self) -> None:
        """Ends without a word."""
        self.is_running = False
        self.ipc.close()
        self.message.close()
        self.steering.close()

    def turn(self) -> None:
        """A turn of the session's loop."""
        if not self.is_running:
            return
        self.reading.sweep()
        take_turn(self, -1, self.ipc, self.message)
        if self.reading.may_hold and self.held is None:
            self.world.after(self.world.random.random() * 0.01, partial(self._read, self.life))
        unsent = sum(len(channel.unsent) for channel in (self.ipc, self.message))
        for machine in (self.reading.machine, self.steering.machine):
            unsent += 0 if machine is None else len(machine.unsent)
        self.look("a client's unsent is bounded", unsent < 1 << 14, unsent)

    def watched(self, machine: Machine) -> Machine:
        """A machine that cannot ignore what comes, nor close because of it, unseen."""
        receive = machine.receive

        def watching(data: bytes, now: float) -> Iterator[Any]:
            for event in receive(data, now):
                crossed = isinstance(event, Ignored) and "[IMG-15]" in event.reason
                is_bad = isinstance(event, (Ignored, MustClose)) and not crossed
                self.look("what a server sends makes sense", not is_bad, event)
                yield event

        machine.receive = watching  # type: ignore[method-assign]
        return machine

    def look(self, invariant: str, holds: bool, *told: object) -> None:
        """As `World.look`."""
        self.world.look(invariant, holds, *((self.name, *told) if not holds else ()))

    def hear(self, error: ErrorMessage) -> None:
        """Takes an error of the server's; a lens may be refused when the size has changed."""
        self.world.note(self.name, "hears", error.code)
        self.is_turned_away |= error.code in TURNED_AWAY
        is_usual = error.code in ORDINARY | TURNED_AWAY or error.pointer == "/intrinsics"
        self.look("who does nothing wrong is not refused", is_usual, error)

    def server_of(self, socket: Any) -> Server:
        """The server that a connection is with."""
        server: Server = socket.peer.owner
        return server

    def is_served(self, socket: Any) -> bool:
        """Whether the server has not ended the connection, whatever the client knows of it."""
        return socket is not None and not socket.is_closed and not socket.peer.is_closed

    # Images

    def lent(self) -> list[Loan]:
        """What it may read."""
        loans = [self.reading.lent, self.reading.held]
        return [
            loan
            for loan in loans
            if loan is not None
            and isinstance(loan.frame, Frame)
            and self.reading.lasts(loan)
            and self.is_served(self.ipc.socket)
        ]

    def _read(self, life: int) -> None:
        """Reads the first half of an image."""
        if life != self.life or not self.is_running or not self.reading.may_hold:
            return
        loan = self.reading.hold()
        assert loan is not None  # no memory is lost here
        if loan.frame.camera is not None:
            self.steering.shown(loan.frame.camera.tag)
        self.held = loan, self.ipc.socket  # type: ignore[assignment]
        self._look_at_half(0)
        longest = 0.005 if self.world.is_calm else self.setting.patience
        self.world.after(self.world.random.random() * longest, partial(self._read_on, life, loan))

    def _read_on(self, life: int, loan: Loan) -> None:
        """Reads the second half, and gives the image back."""
        if life != self.life or not self.is_running or self.reading.held is not loan:
            return
        self._look_at_half(HALVES - 1)
        self.held = None
        self.world.note(self.name, "gives back", loan.frame.seq)
        self.reading.give_back(loan)
        self.ipc.flush(self.clock())
        self.wake()

    def _look_at_half(self, half: int) -> None:
        assert self.held is not None
        loan, socket = self.held
        images: Any = loan.mapped.images
        frame, memory = loan.frame, images.memory
        if isinstance(frame, Glimpse):
            self.seen = self.server_of(socket), memory.read(LEGACY, "color", half)
            return
        if not self.reading.lasts(loan) or not self.is_served(socket):
            return
        server = self.server_of(socket)
        picture = server.pictures[frame.generation, frame.seq]
        for channel in sorted(loan.channels):
            found = memory.read(frame.slot, channel, half)
            told = picture.number, "and half", half, "of its", channel, "is of", found
            self.look("an image is whole", found == picture.number, *told)
        self.seen = server, picture.number
        self.read = loan.channels

    # Steering

    def subscribe(self) -> None:
        """Reads other channels from now on."""
        self.wants = self.world.random.choice(CHANNELS)
        self.reading.subscribe(self.wants)
        self.ipc.flush(self.clock())
        self.wake()

    def act(self) -> None:
        """Does one of the things that a viewer's user does."""
        draw = self.world.random
        kinds = "pose pose tagged lens object time camera size scene ping viewport subscribe"
        kind = draw.choice(kinds.split())
        self.world.note(self.name, kind)
        if kind in ("pose", "tagged", "lens"):
            self.pose(kind)
        elif kind == "object":
            name = draw.choice(("default", "chair", "nothing"))
            self.tell(ObjectPose(name, IDENTITY, draw.choice((1.0, 2.0)), self.clock()))
        elif kind == "time":
            self.tell(SetTime(draw.random() * 4.0 - 1.0))
        elif kind == "subscribe":
            self.subscribe()
        else:
            index = draw.randrange(9)
            requests: dict[str, Request] = {
                "camera": GetCameraPose(index),
                "size": GetViewportSize(),
                "scene": GetScene(),
                "ping": Ping(self.clock()),
                "viewport": SetViewport(1 + index, 2),
            }
            self.ask(requests[kind])

    def pose(self, kind: str = "pose") -> float:
        """Sends a camera that nobody sent before; returns where it is."""
        x = float(next(self.tickets))
        self.has_lens |= kind == "lens"
        lens = Intrinsics(4.0, 4.0, 2.0, 1.0, 4, 2, 0.1, 10.0) if kind == "lens" else None
        pose = Pose((x, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        self.tell(CameraPose(pose, self.clock(), f"{x}" if kind == "tagged" else None, lens))
        self.sent = x
        return x

    def tell(self, message: Any) -> None:
        """As `Session` does."""
        self.steering.tell(message)
        self.message.flush(self.clock())
        self.wake()

    def ask(self, request: Request) -> Future[Any] | None:
        """As `Session` does; the answer is looked at."""
        self.questions = [question for question in self.questions if not question.done()]
        if len(self.questions) >= UNANSWERED:
            return None
        question = self.steering.ask(request)
        self.questions.append(question)
        question.add_done_callback(partial(self._look_at_answer, request))
        self.message.flush(self.clock())
        self.wake()
        return question

    def _look_at_answer(self, request: Request, question: Future[Any]) -> None:
        if question.cancelled():
            return
        if (error := question.exception()) is not None:
            code = error.error.code if isinstance(error, ServerRefusedError) else error
            may_be = ORDINARY if isinstance(request, SetViewport) else TURNED_AWAY
            self.look("a request is answered", code in may_be, request, code)
            return
        answer = question.result()
        if isinstance(request, GetCameraPose):
            holds = answer.pose == CAMERAS[request.cam_idx % len(CAMERAS)]
        elif isinstance(request, SetViewport):
            holds = answer == ViewportSize(request.width, request.height, answer.id)
        elif isinstance(request, GetScene):
            holds = answer.cameras == len(CAMERAS)
        else:
            holds = True
        self.look("a reply is of its request", holds, request, answer)
