"""A well-behaved client: forty poses a second, each seen in an image, and a ping beside each.

For each line of seconds that comes, behaves for so long; prints poses, images that showed them in
time, and round trips (milliseconds), as JSON.
"""

from __future__ import annotations

import contextlib
import json
import select
import socket
import sys
import time
from typing import Any

from splatbus_wire.framing import PacketDecoder

from benchmarks._shared import hello, packet

HERTZ = 40.0
POSE = {"rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "type": "camera_pose"}


class Channel:
    """One connection, as messages."""

    def __init__(self, port: int, token: str, *capabilities: str) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), 5.0)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._decoder = PacketDecoder()
        self.socket.sendall(hello(*capabilities, token=token))

    def send(self, message: dict[str, Any]) -> None:
        self.socket.sendall(packet(message))

    def read(self) -> list[dict[str, Any]]:
        """What is there; ConnectionError at the end."""
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError
        self._decoder.receive(data)
        return [json.loads(each) for each in iter(self._decoder.next_packet, None)]


class Canary:
    def __init__(self, ipc: int, message: int, token: str) -> None:
        self._where = ipc, message, token
        self.number = self.seen = 0
        self.waits: list[float] = []
        self.connect()

    def connect(self) -> None:
        """Connects both channels; the first image has to come."""
        ipc, message, token = self._where
        self.ipc = Channel(ipc, token, "host_shm", "frames", "reinit")
        self.message = Channel(message, token, "ping")

    def behave(self, seconds: float) -> dict[str, Any]:
        """Sends poses, and returns what became of them."""
        self.seen, self.waits = 0, []
        count = round(seconds * HERTZ)
        due = time.perf_counter()
        for _ in range(count):
            try:
                self.number += 1
                tag = str(self.number)
                position = {"x": self.number * 1e-3, "y": 0.0, "z": 0.0}
                self.message.send(POSE | {"position": position, "tag": tag})
                self.message.send({"type": "ping", "t": time.perf_counter(), "id": self.number})
                due += 1 / HERTZ
                self.listen(tag, due)
            except OSError:
                with contextlib.suppress(OSError):
                    self.connect()
                time.sleep(0.05)
                due = time.perf_counter()
        return {"poses": count, "seen": self.seen, "waits": self.waits}

    def listen(self, tag: str, until: float) -> None:
        """Takes what comes until the next pose is due."""
        while (left := until - time.perf_counter()) > 0:
            ready, _, _ = select.select([self.ipc.socket, self.message.socket], [], [], left)
            now = time.perf_counter()
            if self.message.socket in ready:
                pongs = [it for it in self.message.read() if it["type"] == "pong"]
                self.waits += [1e3 * (now - it["t"]) for it in pongs]
            if self.ipc.socket in ready:
                for message in self.ipc.read():
                    self.take(message, tag)

    def take(self, message: dict[str, Any], tag: str) -> None:
        """Opens memory, and gives images back at once."""
        if "meta" in message:
            self.ipc.send({"type": "opened", "generation": message["generation"]})
            for former in range(1, message["generation"]):
                self.ipc.send({"type": "closed", "generation": former})
        elif message["type"] == "frame":
            self.seen += message["camera"].get("tag") == tag
            given = {"generation": message["generation"], "seq": message["seq"]}
            self.ipc.send({"type": "release"} | given)


def main(ipc: int, message: int, token: str) -> None:
    """Until it is told to end."""
    canary = Canary(ipc, message, token)
    for line in sys.stdin:
        print(json.dumps(canary.behave(float(line))), flush=True)
