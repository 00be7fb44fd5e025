"""Clients of the simulation that are not the reference's: in a hurry, or rude."""

from __future__ import annotations

import json
import math
import selectors
from collections import deque
from collections.abc import Iterator

from splatbus_client.channel import Channel
from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import PacketDecoder, encode_packet
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
    decode_from_server_message,
    encode,
)
from splatbus_wire.poses import Pose

from tests.simulation.machine.network import LOOPBACK, Network
from tests.simulation.machine.stand_ins import take_turn
from tests.simulation.machine.world import Node
from tests.simulation.server import CAMERAS, IPC_PORT, MESSAGE_PORT

PROGRAM = Program("visitor", "1")


class Visitor(Node):
    """Keeps one connection by a channel of the reference, whose machine and owner it is."""

    port = MESSAGE_PORT
    hears = selectors.EVENT_READ | selectors.EVENT_WRITE

    def __init__(self, network: Network, hello: Hello | None) -> None:
        super().__init__(network.world)
        self.hello = hello
        self.unsent = bytearray()
        self.channel = Channel("visitor", LOOPBACK, self.port, self)
        self.wake()

    def turn(self) -> None:
        """Reads and writes what can be."""
        take_turn(self, self.hears, self.channel)

    def leave(self) -> None:
        """Ends for good."""
        self.is_alive = False
        self.channel.close()

    def say(self, *packets: bytes) -> None:
        """Sends, as soon as it can."""
        if self.channel.machine is not None:
            self.unsent += b"".join(packets)
            self.channel.flush(self.clock())
            self.wake()

    def begin(self) -> Visitor:
        """A new connection."""
        self.packets = PacketDecoder()
        self.unsent[:] = b"" if self.hello is None else encode(self.hello)
        return self

    def receive(self, data: bytes, now: float) -> Iterator[bytes]:
        """The packets that are complete."""
        self.packets.receive(data)
        while (payload := self.packets.next_packet()) is not None:
            yield payload

    def data_to_send(self, now: float) -> bytes:
        """All that is unsent."""
        data = bytes(self.unsent)
        self.unsent.clear()
        return data

    def deadline(self) -> float:
        """It has all the time."""
        return math.inf

    def expire(self, now: float) -> tuple[bytes, ...]:
        """Nothing does."""
        return ()

    def end(self) -> None:
        """The connection is lost; another follows after a time."""

    def handle(self, payload: bytes) -> None:
        """What is done with a packet."""

    def act(self) -> None:
        """What is done now and then."""


class Pipelining(Visitor):
    """Sends many requests before it has a reply; the replies have to come in their order.

    Attributes:
        asked: what is unanswered.
    """

    def begin(self) -> Visitor:
        """Nothing is asked yet."""
        self.asked: deque[Request] = deque()
        return super().begin()

    def act(self) -> None:
        """Asks some things at once, and moves the camera."""
        draw = self.world.random
        kinds: list[Request] = [GetViewportSize(), GetCameraPose(draw.randrange(9))]
        if self.hello is not None:
            kinds += [Ping(self.clock()), SetViewport(draw.randint(1, 9), 2)]
        if self.channel.machine is None or len(self.asked) > 20:
            return
        for number in range(draw.randint(1, 5)):
            request = draw.choice(kinds)
            if self.hello is not None:
                request = request._replace(id=self.world.steps * 10 + number)
            self.asked.append(request)
            self.say(encode(request))
        if draw.random() < 0.3:
            pose = Pose((-9.0, 0.0, draw.random()), (0.0, 0.0, 0.0, 1.0))
            self.say(encode(CameraPose(pose)))

    def handle(self, payload: bytes) -> None:
        """Compares it with the request that is the first unanswered."""
        request = self.asked[0] if self.asked else None
        try:
            answer = decode_from_server_message(payload, request)
        except ProtocolError as error:
            self.world.look("replies come in order", False, payload, "answers", request, error)
            return
        if b'"welcome"' in payload or (isinstance(answer, ErrorMessage) and answer.id is None):
            return
        asked = self.asked.popleft()
        holds = getattr(answer, "id", None) == asked.id
        if isinstance(asked, GetCameraPose):
            pose = CAMERAS[asked.cam_idx % len(CAMERAS)]
            holds = holds and isinstance(answer, CameraReply) and answer.pose == pose
        self.world.look("replies come in order", holds, asked, answer)


class Rude(Visitor):
    """Does what it should not, of one kind."""

    def __init__(self, network: Network, kind: str, hello: Hello) -> None:
        self.kind = kind
        self.port = network.world.random.choice((IPC_PORT, MESSAGE_PORT))
        if kind in ("keeper", "repeats"):
            self.port = IPC_PORT
        elif kind == "deaf":
            self.hears = selectors.EVENT_WRITE
        super().__init__(network, None if kind in ("silent", "garbage") else hello)

    def act(self) -> None:
        """Goes on."""
        draw = self.world.random
        if self.channel.machine is None or self.channel.socket is None:
            return
        if self.kind == "half":
            self.say(draw.choice((b"\x20\0\0\0{", b"\x05", b"\x40\0\0\0" + bytes(60))))
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
            self.channel.socket.shutdown(1)
        elif self.kind == "leaves" and draw.random() < 0.5:
            self.channel.lose("it leaves", self.clock())

    def handle(self, payload: bytes) -> None:
        """A keeper opens what it is told of, and keeps every image and all memory."""
        if self.kind in ("keeper", "repeats"):
            packet = json.loads(payload)
            if "meta" in packet:
                self.say(encode(Opened(packet["generation"])))


RUDE = "half half garbage deaf repeats half-closes leaves keeper silent".split()
