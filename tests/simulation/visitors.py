"""Clients of the simulation that are not the reference's: of 1.0, in a hurry, or rude."""

from __future__ import annotations

import contextlib
import json
from collections import deque

from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import PacketDecoder, encode_packet
from splatbus_wire.init_packet import init_packet_object
from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    ErrorMessage,
    GetCameraPose,
    GetViewportSize,
    Hello,
    Opened,
    Ping,
    Program,
    Release,
    Request,
    SetViewport,
    ViewportSize,
    decode_from_server_message,
    encode,
)
from splatbus_wire.poses import Pose

from tests.simulation.machine.memory import LEGACY, Memory, Store
from tests.simulation.machine.network import Network, Socket
from tests.simulation.machine.world import Node
from tests.simulation.server import CAMERAS, IPC_PORT, MESSAGE_PORT, Server

PROGRAM = Program("visitor", "1")
AGAIN_SECONDS = 1.0


class Visitor(Node):
    """Keeps one connection, says what it has to say, and takes what comes."""

    port = MESSAGE_PORT

    def __init__(self, network: Network) -> None:
        super().__init__(network.world)
        self.network = network
        self.socket: Socket | None = None
        self.unsent = bytearray()
        self.is_leaving = False
        self._is_connected = False
        self._connect()

    def _connect(self) -> None:
        if self.is_leaving:
            return
        self.packets = PacketDecoder()
        self.unsent.clear()
        self._is_connected = False
        self.socket = Socket(self.network, self)
        with contextlib.suppress(BlockingIOError):
            self.socket.connect(("", self.port))

    def lose(self) -> None:
        """Closes the connection; another follows after a time."""
        if self.socket is not None:
            self.socket.close()
            self.socket = None
            self.world.after(AGAIN_SECONDS, self._connect)

    def leave(self) -> None:
        """Ends for good."""
        self.is_leaving = True
        self.lose()

    def turn(self) -> None:
        """Reads and writes what can be."""
        if self.socket is None:
            return
        try:
            if not self._is_connected:
                if not self.socket.is_writable:
                    return
                if self.socket.getsockopt():
                    self.lose()
                    return
                self._is_connected = True
                self.begin()
            while self.reads and self.socket.is_readable:
                data = self.socket.recv(4096)
                if not data:
                    self.lose()
                    return
                self.packets.receive(data)
                while (payload := self.packets.next_packet()) is not None:
                    self.take(payload)
            while self.unsent:
                del self.unsent[: self.socket.send(self.unsent)]
        except BlockingIOError:
            return
        except OSError:
            self.lose()

    reads = True

    def say(self, *packets: bytes) -> None:
        """Sends, as soon as it can."""
        if self._is_connected:
            self.unsent += b"".join(packets)
            self.wake()

    def begin(self) -> None:
        """What is done on a new connection."""

    def take(self, payload: bytes) -> None:
        """What is done with a packet."""

    def act(self) -> None:
        """What is done now and then."""


class Pipelining(Visitor):
    """Sends many requests before it has a reply; the replies have to come in their order.

    Attributes:
        asked: what is unanswered.
    """

    def __init__(self, network: Network, token: str | None, says_hello: bool) -> None:
        self._hello = Hello(("1.1",), PROGRAM, ("viewport", "ping"), token) if says_hello else None
        self.asked: deque[Request] = deque()
        self._id = 0
        super().__init__(network)

    def begin(self) -> None:
        """Nothing is asked yet."""
        self.asked.clear()
        if self._hello is not None:
            self.say(encode(self._hello))

    def act(self) -> None:
        """Asks some things at once, and moves the camera."""
        draw = self.world.random
        kinds: list[Request] = [GetViewportSize(), GetCameraPose(draw.randrange(9))]
        if self._hello is not None:
            kinds += [Ping(self.clock()), SetViewport(draw.randint(1, 9), 2)]
        if not self._is_connected or len(self.asked) > 20:
            return
        for _ in range(draw.randint(1, 5)):
            self._id += 1
            request = draw.choice(kinds)
            if self._hello is not None:
                request = request._replace(id=self._id)
            self.asked.append(request)
            self.say(encode(request))
        if draw.random() < 0.3:
            pose = Pose((-9.0, 0.0, draw.random()), (0.0, 0.0, 0.0, 1.0))
            self.say(encode(CameraPose(pose)))

    def take(self, payload: bytes) -> None:
        """Compares it with the request that is the first unanswered."""
        look = self.world.look
        request = self.asked[0] if self.asked else None
        try:
            answer = decode_from_server_message(payload, request)
        except ProtocolError as error:
            look("replies come in order", False, payload, "answers", request, error)
            return
        if isinstance(answer, ErrorMessage) and answer.id is None:
            return
        if isinstance(answer, (ErrorMessage, ViewportSize, CameraReply)) or hasattr(answer, "t"):
            asked = self.asked.popleft()
            holds = getattr(answer, "id", None) == asked.id
            if isinstance(asked, GetCameraPose):
                index = asked.cam_idx % len(CAMERAS)
                holds = holds and isinstance(answer, CameraReply) and answer.pose == CAMERAS[index]
            look("replies come in order", holds, asked, answer)


class LegacyViewer(Visitor):
    """A client of 1.0, which says nothing and looks at the buffers whenever it likes.

    Attributes:
        memory: that was announced last on this connection.
    """

    port = IPC_PORT

    def __init__(self, network: Network, store: Store) -> None:
        self.store = store
        self.memory: Memory | None = None
        super().__init__(network)

    def begin(self) -> None:
        """Nothing is announced yet."""
        self.memory = None

    def take(self, payload: bytes) -> None:
        """Opens what is announced: nothing else may come."""
        packet = json.loads(payload)
        look = self.world.look
        look("who says nothing gets one init packet", self.memory is None and "meta" in packet)
        (self.memory,) = (m for m in self.store.made.values() if _handle(m) == packet["mem_color"])

    def seen(self) -> int:
        """The number of the image that it sees."""
        return 0 if self.memory is None else self.memory.read(LEGACY, "color", 0)

    def server(self) -> Server | None:
        """Whom it is connected with."""
        peer = self.socket.peer if self.socket is not None else None
        owner = peer.owner if peer is not None else None
        return owner if isinstance(owner, Server) else None


def _handle(memory: Memory) -> str:
    handle: str = init_packet_object(memory.init_packet).get("mem_color", "")
    return handle


class Rude(Visitor):
    """Does what it should not, of one kind."""

    def __init__(
        self, network: Network, kind: str, token: str | None, ipc: tuple[str, ...]
    ) -> None:
        self.kind = kind
        self.port = network.world.random.choice((IPC_PORT, MESSAGE_PORT))
        if kind in ("keeper", "repeats"):
            self.port = IPC_PORT
        self.reads = kind != "deaf"
        self._hello = encode(Hello(("1.1",), PROGRAM, (*ipc, "telemetry", "scene"), token))
        super().__init__(network)

    def begin(self) -> None:
        """Begins to be rude."""
        if self.kind not in ("silent", "garbage"):
            self.say(self._hello)

    def act(self) -> None:
        """Goes on."""
        draw = self.world.random
        if self.socket is None or not self._is_connected:
            return
        if self.kind == "half":
            self.say(draw.choice((b"\x20\0\0\0{", b"\x05", self._hello[:-3])))
        elif self.kind == "garbage":
            self.say(draw.randbytes(draw.randint(1, 40)))
        elif self.kind == "deaf":
            self.say(encode(GetViewportSize()) * 20, encode_packet(b'{"type":"get_scene"}') * 20)
        elif self.kind == "repeats":
            self.say(
                encode(draw.choice((Opened(1), Release(1, draw.randint(1, 9)), Opened(2)))),
                encode_packet(b'{"type":"what"}'),
            )
        elif self.kind == "half-closes" and draw.random() < 0.3:
            self.socket.shutdown(1)
        elif self.kind == "leaves" and draw.random() < 0.5:
            self.lose()

    def take(self, payload: bytes) -> None:
        """A keeper opens what it is told of, and keeps every image and all memory."""
        if self.kind in ("keeper", "repeats"):
            packet = json.loads(payload)
            if "meta" in packet:
                self.say(encode(Opened(packet["generation"])))


RUDE = "half half garbage deaf repeats half-closes leaves keeper silent".split()
