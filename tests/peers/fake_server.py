"""Both channels of a server, driven line by line from a test: raw sockets and plain JSON."""

import os
import secrets
import socket
from pathlib import Path

import numpy as np
from splatbus_schemas import examples
from splatbus_wire.poses import Pose

from tests.peers.raw_client import End

SECONDS = 10.0
WIDTH, HEIGHT, SLOTS = 6, 4, 3
SIZE = SLOTS * WIDTH * HEIGHT * 20


def example(name):
    """The first valid example of a message in the specification."""
    return examples(name, "1.1")[0][0].message


HOST = example("init_packet")
SEMANTICS = HOST["semantics"]
META = HOST["meta"] | {
    "w": WIDTH,
    "h": HEIGHT,
    "pitchColor": 16 * WIDTH,
    "pitchDepth": 4 * WIDTH,
}
CAMERA = example("frame")["camera"] | {
    "cx": WIDTH / 2,
    "cy": HEIGHT / 2,
    "width": WIDTH,
    "height": HEIGHT,
}
POSE = Pose((1.0, -2.0, 5.0), (-0.1, 0.2, -0.3, 0.9273618495495703))
CAMERA_REPLY = {"position": list(POSE.position), "rotation": list(POSE.rotation)}
IPC_CAPABILITIES = ("host_shm", "frames", "reinit", "subscribe")
MESSAGE_CAPABILITIES = (
    "intrinsics",
    "objects",
    "scene",
    "viewport",
    "time",
    "ping",
    "telemetry",
)
LENS = {
    "fx": 1500.0,
    "fy": 1400.0,
    "cx": 960.5,
    "cy": 540.0,
    "width": 1920,
    "height": 1080,
    "near": 0.01,
    "far": 100.0,
}
GARDEN = {name: value for name, value in example("scene").items() if name != "id"}
CHAIR = {"id": "chair", "name": "", "gaussians": 7, "bounds": None}
SCENE = GARDEN | {"objects": [*GARDEN["objects"], CHAIR], "timeRange": [0.0, 4.0]}
TELEMETRY = example("telemetry")
HANDLE = "A" * 86 + "=="


def welcome(*capabilities, version="1.1"):
    return {
        "type": "welcome",
        "version": version,
        "server": {"name": "fake", "version": "0"},
        "capabilities": list(capabilities),
    }


def init_packet(name="client-test-none", generation=1, size=SIZE, **members):
    pixels = WIDTH * HEIGHT
    layout = {
        "slots": SLOTS,
        "colorStride": 16 * pixels,
        "depthOffset": SLOTS * 16 * pixels,
        "depthStride": 4 * pixels,
    }
    memory = {"kind": "host_shm", "name": name, "bytes": size}
    ring = HOST["ring"] | layout
    return HOST | {"generation": generation, "meta": META, "memory": memory, "ring": ring} | members


def cuda_init_packet(**members):
    return {
        "meta": META,
        "mem_color": HANDLE,
        "mem_depth": HANDLE,
        "evt_done": HANDLE,
    } | members


def frame(seq, slot=0, generation=1, **members):
    told = {"generation": generation, "seq": seq, "slot": slot, "camera": CAMERA}
    return example("frame") | told | members


def image(seed):
    """Top-down colour and depth that no other seed has."""
    values = np.random.default_rng(seed).random((HEIGHT, WIDTH, 5), np.float32)
    return values[..., :4], values[..., 4] + 1


class Memory:
    """Shared memory as a server makes it, with recognisable images in its slots."""

    def __init__(self, size=SIZE):
        # No name that a reference server would take for one of its own and tidy up.
        self.name = f"client-test-{secrets.token_hex(4)}"
        self.path = Path("/dev/shm") / self.name
        with os.fdopen(os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600), "wb") as file:
            file.truncate(size)

    def write(self, slot, color, depth):
        """Store an image given top-down: (HEIGHT, WIDTH, 4) and (HEIGHT, WIDTH) float32."""
        pixels = WIDTH * HEIGHT
        with self.path.open("r+b") as file:
            file.seek(slot * 16 * pixels)
            file.write(np.ascontiguousarray(color[::-1], "<f4").tobytes())
            file.seek(SLOTS * 16 * pixels + slot * 4 * pixels)
            file.write(np.ascontiguousarray(depth[::-1], "<f4").tobytes())

    def remove(self):
        self.path.unlink(missing_ok=True)


class Peer(End):
    """The server's end of one connection."""

    def __init__(self, connection):
        super().__init__(connection, SECONDS)

    def receive(self):
        """The next message; EOFError if the client ended the connection."""
        message = super().receive()
        if message is None:
            raise EOFError
        return message

    def receive_type(self, kind):
        """The next message of a type; others are skipped."""
        while (message := self.receive()).get("type") != kind:
            pass
        return message

    def ended(self):
        """Whether the client ends the connection, after whatever it still sends."""
        try:
            while self.socket.recv(65536):
                pass
        except ConnectionResetError:
            pass
        except TimeoutError:
            return False
        return True


class FakeServer:
    """Listens on two ports of its own; `stop` and `start` keep them."""

    def __init__(self):
        self.ipc_port = self.message_port = 0
        self._peers = []
        self.start()

    def start(self):
        self._ipc = socket.create_server(("127.0.0.1", self.ipc_port))
        self._message = socket.create_server(("127.0.0.1", self.message_port))
        self.ipc_port = self._ipc.getsockname()[1]
        self.message_port = self._message.getsockname()[1]
        for listener in (self._ipc, self._message):
            listener.settimeout(SECONDS)

    def stop(self):
        for thing in (self._ipc, self._message, *self._peers):
            thing.close()

    def ipc(self):
        return self._accept(self._ipc)

    def message(self):
        return self._accept(self._message)

    def ipc_1_1(self, *capabilities):
        """An IPC connection that has negotiated."""
        peer = self.ipc()
        peer.hello = peer.receive()
        peer.send(welcome(*(capabilities or IPC_CAPABILITIES)))
        return peer

    def ipc_opened(self, memory, generation=1):
        """An IPC connection on which the client has opened the memory."""
        peer = self.ipc_1_1()
        peer.send(init_packet(memory.name, generation))
        assert peer.receive() == {"type": "opened", "generation": generation}
        return peer

    def message_1_1(self, size=(WIDTH, HEIGHT), capabilities=MESSAGE_CAPABILITIES):
        """A message connection that has negotiated, and been told the viewport's size."""
        peer = self.message()
        peer.hello = peer.receive()
        peer.send(welcome(*capabilities))
        assert peer.receive() == {"type": "get_viewport_size"}
        peer.send({"type": "viewport_size", "viewport_size": list(size)})
        return peer

    def _accept(self, listener):
        peer = Peer(listener.accept()[0])
        self._peers.append(peer)
        return peer
