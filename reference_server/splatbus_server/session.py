"""What messages do: move the camera, answer requests, lend images. No socket, no clock.

``connection`` knows what holds for each connection by itself; this module what they all share.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    ClientMessage,
    Closed,
    Frame,
    FrameCamera,
    GetCameraPose,
    GetViewportSize,
    Hello,
    Opened,
    OpenFailed,
    PointCloudPose,
    Release,
    Subscribe,
    ViewportSize,
)
from splatbus_wire.poses import IDENTITY, Pose

from splatbus_server.connection import Connection, Refusal
from splatbus_server.control import Control
from splatbus_server.exchange import BOTH, WITH_LEGACY, Exchange, Image
from splatbus_server.memory import FrameMemory
from splatbus_server.statistics import Statistics

News = CameraPose | PointCloudPose | Hello | Opened | OpenFailed | Closed | Release | Subscribe

CAPABILITIES = ("host_shm", "frames", "reinit", "subscribe")
"""What this server can do on the IPC channel; `cuda_ipc` takes the place of `host_shm` where its
memory is on a GPU."""


@dataclass
class Reader:
    """What a client on the IPC channel was told, and what it answered.

    Attributes:
        announced: memory by generation, from init packet to `open_failed` or `closed`.
        opened: the generations of these that it said it had opened.
        told: the newest generation that it was told of.
        wants: channels, from `subscribe`.
        lease: the image that it holds.
    """

    announced: dict[int, FrameMemory] = field(default_factory=dict)
    opened: set[int] = field(default_factory=set)
    told: int = 0
    wants: frozenset[str] = BOTH
    lease: Image | None = None


class Session:
    """All connections of a server, and the one scene that they look at.

    Attributes:
        has_news: there is something for `catch_up` to pass on; a publisher says so too.
    """

    def __init__(
        self,
        exchange: Exchange,
        cameras: Sequence[Pose],
        readers: int,
        statistics: Statistics,
    ) -> None:
        """Starts without connections.

        Args:
            exchange: with the renderer.
            cameras: that the scene comes with [REQ-6].
            readers: how many clients may hold an image at a time [IMG-18].
            statistics: to count in.
        """
        self._exchange = exchange
        self._cameras = tuple(cameras) or (IDENTITY,)
        self._most_readers = readers
        self._statistics = statistics
        self._control = Control(exchange.poses)
        self._moves: Counter[type] = Counter()
        self.has_news = False
        self._told_busy: set[Connection] = set()
        self._readers: dict[Connection, Reader] = {}

    def join(self, connection: Connection) -> None:
        """Takes a new connection on the IPC channel of a server that requires no token.

        Memory on a GPU is announced to it at once: it may be of 1.0 and never say a word
        [CHN-4, NEG-15].
        """
        if self._exchange.memory.kind == "cuda_ipc":
            self._readers[connection] = Reader()
            self.has_news = True

    def handle(self, connection: Connection, message: ClientMessage, now: float) -> Refusal | None:
        """Does what the message asks for, or says why not."""
        match message:
            case GetViewportSize():
                memory = self._exchange.memory
                connection.send(ViewportSize(memory.width, memory.height, message.id))
                self._statistics.requests += 1
            case GetCameraPose():
                camera = self._cameras[message.cam_idx % len(self._cameras)]
                connection.send(CameraReply(camera, message.id))
                self._statistics.requests += 1
            case _:
                self.has_news = True
                return self._take(connection, message, now)
        return None

    def _take(self, connection: Connection, message: News, now: float) -> Refusal | None:
        match message:
            case CameraPose() | PointCloudPose():
                return self._move(connection, message)
            case Hello():
                return self._greet(connection, now)
            case Opened() | OpenFailed() | Closed():
                return self._answered(connection, message)
            case Release():
                return self._release(connection, message)
            case Subscribe(channels):
                return self._subscribe(connection, channels)

    def leave(self, connection: Connection) -> None:
        """Ends what a connection had: control of the camera [POS-11], its lease [IMG-17]."""
        self.has_news = True
        self._told_busy.discard(connection)
        if self._control.leave(connection):
            self._moves[CameraPose] += 1
        reader = self._readers.pop(connection, None)
        if reader is not None:
            for memory in reader.announced.values():
                self._exchange.forget(connection, memory)

    def catch_up(self, now: float) -> None:
        """Passes on what changed since the last call: poses to the renderer, images to clients.

        Once for all that arrived together, so that of many poses only the newest counts.
        """
        self.has_news = False
        if self._moves:
            self._exchange.move(self._control.poses, self._moves)
            self._moves = Counter()
        memory = self._exchange.memory
        for connection, reader in self._readers.items():
            if reader.told < memory.generation and connection.ending is None:
                self._announce(connection, reader, memory, now)
        ready = {
            connection: reader
            for connection, reader in self._readers.items()
            if memory.generation in reader.opened and connection.has("frames")
        }
        wanted: frozenset[str] = frozenset().union(*(r.wants for r in ready.values()))
        self._exchange.want(WITH_LEGACY if self._is_legacy_slot_seen(memory) else wanted, memory)
        for connection, reader in ready.items():
            if reader.lease is None and connection.ending is None:
                self._lend(connection, reader, memory)
        self._free(now)

    def _is_legacy_slot_seen(self, memory: FrameMemory) -> bool:
        """Whether a client without `frames` is there, of 1.0 or later: it copies when it likes."""
        return memory.kind == "cuda_ipc" and any(
            reader.told == memory.generation
            and connection.ending is None
            and not connection.has("frames")
            for connection, reader in self._readers.items()
        )

    def _move(self, connection: Connection, message: CameraPose | PointCloudPose) -> Refusal | None:
        if self._control.move(connection, message):
            self._moves[type(message)] += 1
            self._statistics.poses_received += 1
            return None
        refusal = Refusal("busy", "another client moves the camera [POS-11]")
        if connection not in self._told_busy:
            self._told_busy.add(connection)
            connection.complain(refusal)
        return refusal

    def _greet(self, connection: Connection, now: float) -> Refusal | None:
        """Takes an IPC client that can open the memory [NEG-11, CHN-5] for a reader."""
        version = connection.welcome.version if connection.welcome else "1.0"
        is_named = connection.has("host_shm") and version != "1.0"
        is_reader = is_named or self._exchange.memory.kind == "cuda_ipc"
        if connection.channel != "ipc" or not is_reader:
            return None
        with_frames = sum(other.has("frames") for other in self._readers if other is not connection)
        if connection.has("frames") and with_frames == self._most_readers:
            reason = f"{with_frames} clients read images already [IMG-18]"
            refusal = connection.complain(Refusal("too_many_clients", reason))
            connection.end(reason, now)
            return refusal
        self._readers.setdefault(connection, Reader())
        return None

    def _announce(
        self, connection: Connection, reader: Reader, memory: FrameMemory, now: float
    ) -> None:
        if reader.told and not connection.has("reinit"):
            connection.end("the image has another size now, and it takes no reinit [OPN-7]", now)
            return
        connection.send(memory.init_packet)
        reader.told = memory.generation
        reader.announced[memory.generation] = memory

    def _answered(
        self, connection: Connection, message: Opened | OpenFailed | Closed
    ) -> Refusal | None:
        reader = self._readers.get(connection)
        generation = message.generation
        if reader is None or generation not in reader.announced:
            reason = f"generation {generation} is not announced here [OPN-12]"
            return connection.complain(Refusal("invalid_message", reason))
        if isinstance(message, Opened):
            reader.opened.add(generation)
            return None
        self._exchange.forget(connection, reader.announced.pop(generation))
        reader.opened.discard(generation)
        if reader.lease is not None and reader.lease.memory.generation == generation:
            reader.lease = None
        if isinstance(message, OpenFailed):
            return Refusal("open_failed", f"the client could not open it: {message.reason!r}")
        return None

    def _release(self, connection: Connection, message: Release) -> Refusal | None:
        reader = self._readers.get(connection)
        lease = reader.lease if reader is not None else None
        if reader is None or lease is None or message != _receipt(lease):
            reason = f"image {message.seq} of generation {message.generation} is not held [IMG-16]"
            return connection.complain(Refusal("invalid_message", reason))
        self._exchange.take_back(connection, lease)
        reader.lease = None
        return None

    def _subscribe(self, connection: Connection, channels: frozenset[str]) -> Refusal | None:
        reader = self._readers.get(connection)
        if reader is None or not connection.has("subscribe"):
            reason = "subscribe was not agreed upon [NEG-5]"
            return connection.complain(Refusal("unsupported", reason))
        reader.wants = channels
        return None

    def _lend(self, connection: Connection, reader: Reader, memory: FrameMemory) -> None:
        image = self._exchange.lend(connection, memory, reader.wants)
        if image is not None:
            reader.lease = image
            connection.send(_frame(image))
            self._statistics.frames_sent += 1

    def _free(self, now: float) -> None:
        """Frees memory that was replaced once no client has it; ends who has it too long.

        Two generations are kept at most: who still has the one before the last when the image
        changes its size again is asked to connect anew.
        """
        for age, memory in enumerate(self._exchange.replaced[::-1]):
            having = [c for c, r in self._readers.items() if memory.generation in r.announced]
            if not having:
                self._exchange.free(memory)
            elif age > 0:
                for connection in having:
                    connection.end("it did not let go of memory that was replaced twice", now)


def _receipt(image: Image) -> Release:
    return Release(image.memory.generation, image.seq)


def _frame(image: Image) -> Frame:
    view = image.view
    fx, fy, cx, cy, near, far = view.intrinsics
    return Frame(
        image.memory.generation,
        image.seq,
        image.slot,
        FrameCamera(view.poses.camera, fx, fy, cx, cy, view.width, view.height, near, far),
        image.time,
        image.rendered_at,
    )
