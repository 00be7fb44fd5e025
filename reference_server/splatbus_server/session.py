"""What messages do: steer the scene, answer requests, lend images. No socket, no clock, no thread.

``connection`` knows what holds for each connection by itself; this module what they all share.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    ClientMessage,
    Closed,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Move,
    ObjectPose,
    Opened,
    OpenFailed,
    Ping,
    Placement,
    PointCloudPose,
    Pong,
    Release,
    Request,
    Scene,
    SetTime,
    SetViewport,
    Subscribe,
    SubscribeTelemetry,
    ViewportSize,
)
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.superseding import subject

from splatbus_server.connection import Connection, Refusal
from splatbus_server.control import Control, Poses
from splatbus_server.exchange import WITH_LEGACY, Exchange
from splatbus_server.limits import DEFAULT, Limits
from splatbus_server.logs import log
from splatbus_server.memory import FrameMemory
from splatbus_server.reader import Reader, receipt
from splatbus_server.statistics import Statistics
from splatbus_server.steering import objection, within
from splatbus_server.telemetry import Readings
from splatbus_server.view import Intrinsics, field_of_view
from splatbus_server.viewport import Viewport

CAPABILITIES = ("host_shm", "frames", "reinit", "subscribe")
"""What this server can do on the IPC channel; `cuda_ipc` takes the place of `host_shm` where its
memory is on a GPU."""
MESSAGE_CAPABILITIES = ("intrinsics", "objects", "scene", "viewport", "time", "ping", "telemetry")
"""What it can do on the message channel; `time` only where the scene has a range [TIM-4]."""
MOST_TOLD = 8
"""As many programs are named of those that were told of memory."""


class Session:
    """All connections of a server, and the one scene that they look at.

    Attributes:
        has_news: there is something for `catch_up` to pass on; a publisher says so too.
        deadline: the moment by which `catch_up` has something to do without any news.
        scene: what `get_scene` tells.
        viewport: has chores for another thread.
        exchange: with the renderer.
        control: who steers.
        readers: what each client on the IPC channel was told and still has.
        readings: telemetry from the renderer.
        statistics: to count in.
        told_programs: the last that were told of memory.
        told_busy: who knows that it does not steer [CTL-2].
    """

    def __init__(
        self,
        memory: FrameMemory,
        scene: Scene,
        cameras: Sequence[Pose] = (),
        intrinsics: Intrinsics | None = None,
        limits: Limits = DEFAULT,
    ) -> None:
        """Starts without connections.

        Args:
            memory: where images are published at first.
            scene: what `get_scene` tells at first; its objects are at rest.
            cameras: that the scene comes with [REQ-6]; the first is where a view begins.
            intrinsics: the renderer's own; those of `field_of_view` if not given.
            limits: to what clients may take.
        """
        self.has_news = False
        self.deadline = math.inf
        self.scene = scene
        self.statistics = Statistics()
        self.readings = Readings(self.statistics)
        self._cameras = tuple(cameras) or (IDENTITY,)
        at_rest = {each.id: Placement(each.id, IDENTITY) for each in scene.objects}
        self.control = Control(Poses(self._cameras[0], at_rest))
        lens = intrinsics or field_of_view(memory.width, memory.height)
        self.exchange = Exchange(memory, lens, self.control.poses, self.statistics)
        self.viewport = Viewport(self.exchange, limits)
        self._moves: Counter[object] = Counter()
        self.told_programs: tuple[str, ...] = ()
        self.told_busy: set[Connection] = set()
        self.readers: dict[Connection, Reader] = {}

    def join(self, connection: Connection) -> None:
        """Takes a new connection on the IPC channel of a server that requires no token.

        Memory on a GPU is announced to it at once: it may be of 1.0 and never say a word
        [CHN-4, NEG-15].
        """
        if self.exchange.memory.kind == "cuda_ipc":
            self.readers[connection] = Reader()
            self.has_news = True

    def handle(self, connection: Connection, message: ClientMessage, now: float) -> Refusal | None:
        """Does what the message asks for, or says why not."""
        if isinstance(message, (CameraPose, PointCloudPose, ObjectPose, SetTime)):
            return self.move(connection, message)
        if isinstance(message, (GetViewportSize, GetCameraPose, GetScene, SetViewport, Ping)):
            return self.answer(connection, message, now)
        self.has_news = True
        if isinstance(message, Hello):
            return self.greet(connection, now)
        if isinstance(message, (Opened, OpenFailed, Closed)):
            return self.take_answer(connection, message)
        if isinstance(message, Release):
            return self.release(connection, message)
        if isinstance(message, Subscribe):
            return self.subscribe(connection, message.channels)
        if isinstance(message, SubscribeTelemetry):
            self.readings.subscribe(connection, message.names)
        return None

    def leave(self, connection: Connection) -> None:
        """Ends what a connection had: control of the scene [POS-11], its lease [IMG-17]."""
        self.has_news = True
        connection.abort("it was lost")  # a wish of it may be under way, and is nobody's now
        self.told_busy.discard(connection)
        self.control.leave(connection)
        self.viewport.askers.discard(connection)
        self.readings.unsubscribe(connection)
        reader = self.readers.pop(connection, None)
        if reader is not None:
            for memory in reader.announced.values():
                self.exchange.forget(connection, memory)

    def catch_up(self, now: float) -> None:
        """Passes on what changed since the last call: poses to the renderer, images to clients.

        Once for all that arrived together, so that of many poses only the newest counts.
        """
        self.has_news = False
        if self.control.poses is not self.exchange.poses:
            self.exchange.move(self.control.poses, self._moves)
            self._moves = Counter()
        refusal = self.viewport.settle(self.hindrance, now)
        if refusal is not None:
            self.statistics.refused[refusal.code] += 1
        memory = self.exchange.memory
        unaware = [c for c, r in self.readers.items() if r.told < memory.generation and c.is_open]
        if unaware and not self.make_anew_if_taken(memory):
            for connection in unaware:
                self.announce(connection, self.readers[connection], memory, now)
        ready = {
            connection: reader
            for connection, reader in self.readers.items()
            if memory.generation in reader.opened and reader.is_let_in
        }
        for connection, reader in ready.items():
            if reader.lease is None and connection.is_open:
                self.lend(connection, reader, memory)
        wanted: frozenset[str] = frozenset().union(*(r.needs for r in ready.values()))
        self.exchange.want(WITH_LEGACY if self._is_legacy_slot_seen(memory) else wanted, memory)
        for connection, reader in ready.items():
            if reader.lacks and connection.is_open:
                self.exchange.renew(connection, memory)
        self.deadline = math.inf
        if self.exchange.replaced:
            self.end_who_keeps(now)
            self.free_replaced(now)
        if self.viewport.is_left_over and self.can_all_follow:
            self.viewport.begin(None, SetViewport(*self.exchange.own_size))
        self.readings.pass_on()

    def _is_legacy_slot_seen(self, memory: FrameMemory) -> bool:
        """Whether a client without `frames` is there, of 1.0 or later: it copies when it likes."""
        return memory.kind == "cuda_ipc" and any(
            reader.told == memory.generation and connection.is_open and not connection.has("frames")
            for connection, reader in self.readers.items()
        )

    def move(self, connection: Connection, message: Move) -> Refusal | None:
        """Applies a pose or a time of who has control; tells others once [CTL-1, CTL-2]."""
        memory = self.exchange.memory
        refusal = objection(connection, message, self.control.poses, memory.width, memory.height)
        if refusal is not None:
            return connection.complain(refusal)
        if self.control.move(connection, within(message, self.scene.time_range)):
            self.has_news = True
            self._moves[subject(message)] += 1
            self.statistics.poses_received += 1
            return None
        refusal = Refusal("busy", "another client steers the scene [POS-11]")
        if connection not in self.told_busy:  # CTL-1, CTL-2
            self.told_busy.add(connection)
            connection.complain(refusal)
        return refusal

    def answer(self, connection: Connection, request: Request, now: float) -> Refusal | None:
        """Replies to a request, but to `set_viewport`: that is begun."""
        self.statistics.requests += 1
        if isinstance(request, GetViewportSize):
            memory = self.exchange.memory
            connection.send(ViewportSize(memory.width, memory.height, request.id))
        elif isinstance(request, GetCameraPose):
            camera = self._cameras[request.cam_idx % len(self._cameras)]
            lens = self.exchange.lens if connection.has("intrinsics") else None  # CAM-8
            connection.send(CameraReply(camera, request.id, lens))
        elif isinstance(request, GetScene):
            connection.send(self.scene._replace(id=request.id))
        elif isinstance(request, Ping):
            connection.send(Pong(request.t, now, request.id))
        else:
            self.free_replaced(now)  # of what the messages before this one let go of
            if not self.viewport.is_as(request):
                refusal = self.hindrance(connection) or self.viewport.objection(request)
                if refusal is not None:
                    return connection.complain(refusal._replace(id=request.id))
            self.has_news = True
            self.viewport.set(connection, request)
        return None

    @property
    def can_all_follow(self) -> bool:
        """Whether every client that reads takes an init packet of another size."""
        return all(
            connection.has("reinit")
            for connection, reader in self.readers.items()
            if reader.told and connection.is_open
        )

    def hindrance(self, asker: Connection) -> Refusal | None:
        """Why images cannot have another size now, if a client asks for it."""
        if not self.can_all_follow:
            return Refusal("unsupported", "a client that reads takes no reinit [VPT-3]")
        if self.control.holder not in (None, asker):
            return Refusal("busy", "another client steers the scene [VPT-4]")
        if self.exchange.replaced or self.viewport.is_changing:
            return Refusal("busy", "memory of the former size is in use [VPT-4]")
        return None

    def greet(self, connection: Connection, now: float) -> Refusal | None:
        """Takes an IPC client that can open the memory [NEG-11, CHN-5] for a reader."""
        is_reader = connection.has("host_shm") or self.exchange.memory.kind == "cuda_ipc"
        if connection.channel != "ipc" or not is_reader:
            return None
        let_in = sum(reader.is_let_in for reader in self.readers.values())
        if connection.has("frames") and let_in == self.exchange.memory.ring.clients:
            reason = f"{let_in} clients read images already [IMG-18]"
            refusal = connection.complain(Refusal("too_many_clients", reason))
            connection.end(reason, now)
            return refusal
        self.readers.setdefault(connection, Reader()).is_let_in = connection.has("frames")
        return None

    def announce(
        self, connection: Connection, reader: Reader, memory: FrameMemory, now: float
    ) -> None:
        """Sends an init packet, or ends who takes no further one [OPN-7]."""
        if reader.told and not connection.has("reinit"):
            connection.end("images are in other memory now, and it takes no reinit [OPN-7]", now)
            return
        self.told_programs = (*self.told_programs, connection.program)[-MOST_TOLD:]
        connection.send(memory.init_packet)
        reader.tell(memory, now)

    def make_anew_if_taken(self, memory: FrameMemory) -> bool:
        """Has other memory made if another program has taken something of this; whether it is."""
        taken = memory.taken()
        if not taken or memory.generation == self.viewport.stays:
            return False
        if not self.viewport.is_changing:
            self.tell_taken(taken)
            self.viewport.begin(None, SetViewport(memory.width, memory.height))
        return True

    def tell_taken(self, what: str) -> None:
        """Logs that another program has taken this, and who may have."""
        told, self.told_programs = dict.fromkeys(self.told_programs), ()
        log.error(
            "another program has taken away %s: images go on in memory that is made anew. It was "
            "announced to %s. What attaches by Python's multiprocessing.shared_memory removes the "
            "memory when it ends, unless it says track=False (since 3.13) or takes it from the "
            "resource tracker (resource_tracker.unregister)",
            what,
            ", ".join(told) or "nobody",
        )

    def take_answer(
        self, connection: Connection, message: Opened | OpenFailed | Closed
    ) -> Refusal | None:
        """Takes what a client says of memory that was announced to it."""
        reader = self.readers.get(connection)
        generation = message.generation
        if reader is None or generation not in reader.announced:
            reason = f"generation {generation} is not announced here [OPN-12]"
            return connection.complain(Refusal("invalid_message", reason))
        if isinstance(message, Opened):
            reader.open(generation)
            return None
        self.exchange.forget(connection, reader.announced.pop(generation))
        reader.opened.discard(generation)
        if reader.lease is not None and reader.lease.memory.generation == generation:  # OPN-14
            reader.lease = None
        if isinstance(message, OpenFailed):
            self.make_anew_if_taken(self.exchange.memory)
            return Refusal("open_failed", f"the client could not open it: {message.reason!r}")
        return None

    def release(self, connection: Connection, message: Release) -> Refusal | None:
        """Takes an image back from who holds it [IMG-16]."""
        reader = self.readers.get(connection)
        lease = reader.lease if reader is not None else None
        if reader is None or lease is None or message != receipt(lease):
            reason = f"image {message.seq} of generation {message.generation} is not held [IMG-16]"
            return connection.complain(Refusal("invalid_message", reason))
        self.exchange.take_back(connection, lease)
        reader.give_back()
        return None

    def subscribe(self, connection: Connection, channels: frozenset[str]) -> Refusal | None:
        """Takes which channels a client reads from now on."""
        reader = self.readers.get(connection)
        if reader is None:
            return connection.complain(Refusal("unsupported", "there is no memory to read from"))
        reader.subscribe(channels)
        return None

    def lend(self, connection: Connection, reader: Reader, memory: FrameMemory) -> None:
        """Sends the newest image, if it is new for the client [IMG-3]."""
        image = self.exchange.lend(connection, memory, reader.needs)
        if image is not None:
            reader.take(image)
            connection.send(reader.frame(image))
            self.statistics.frames_sent += 1

    def end_who_keeps(self, now: float) -> None:
        """Disconnects who has had former memory for too long [VPT-8]."""
        for connection, reader in self.readers.items():
            late_at = reader.late_at
            if late_at is None or not connection.is_open:
                continue
            if now >= late_at:
                connection.end("it did not let go of former memory in time [VPT-8]", now)
            else:
                self.deadline = min(self.deadline, late_at)

    def free_replaced(self, now: float) -> None:
        """Frees memory that was replaced once no client has it [OPN-8, VPT-7].

        Two generations are kept at most: who still has the one before the last when the image
        changes its size again is asked to connect anew.
        """
        for age, memory in enumerate(self.exchange.replaced[::-1]):
            having = [c for c, r in self.readers.items() if memory.generation in r.announced]
            if not having and self.exchange.give_up(memory):
                self.viewport.chores.append(memory.close)
            elif age > 0:
                for connection in having:
                    connection.end("it did not let go of memory that was replaced twice", now)
