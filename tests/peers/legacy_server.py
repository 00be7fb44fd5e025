"""A server of 1.0, as they are deployed: what was never written down is what it does."""

from __future__ import annotations

import contextlib
import json
import socket
import struct
import threading
from collections.abc import Iterator

from splatbus_schemas import prose

from tests.peers.raw_client import packet

POSITION, ROTATION = [1.0, -2.0, 5.0], [0.0, 0.0, 0.0, 1.0]


def init_packet_of_1_0() -> bytes:
    """The init packet that the specification of 1.0 shows."""
    return next(e.packet for e in prose.examples("1.0") if e.name.startswith("init_packet"))


class ServerOf10:
    """A server of 1.0: sends the init packet at once, replies in order, ignores the rest."""

    def __init__(self, size: tuple[int, int] = (64, 48)) -> None:
        self.size = list(size)
        self._listeners = {
            "ipc": socket.create_server(("127.0.0.1", 0)),
            "msg": socket.create_server(("127.0.0.1", 0)),
        }
        self._held: list[socket.socket] = []
        self._threads = [
            threading.Thread(target=self._accept, args=(name,), daemon=True)
            for name in self._listeners
        ]
        for thread in self._threads:
            thread.start()

    @property
    def ports(self) -> tuple[int, int]:
        ipc, msg = (self._listeners[name].getsockname()[1] for name in ("ipc", "msg"))
        return ipc, msg

    def close(self) -> None:
        for each in (*self._listeners.values(), *self._held):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        for thread in self._threads:
            thread.join(20.0)

    def _accept(self, channel: str) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listeners[channel].accept()
                self._held.append(connection)
                if channel == "ipc":
                    connection.sendall(init_packet_of_1_0())
                else:
                    thread = threading.Thread(target=self._serve, args=(connection,), daemon=True)
                    self._threads.append(thread)
                    thread.start()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError, struct.error), connection.makefile("rb") as stream:
            while True:
                (length,) = struct.unpack("<I", stream.read(4))
                message = json.loads(stream.read(length))
                if message.get("type") == "get_viewport_size":
                    connection.sendall(packet({"viewport_size": self.size}))
                elif message.get("type") == "get_camera_pose":
                    connection.sendall(packet({"position": POSITION, "rotation": ROTATION}))


@contextlib.contextmanager
def running() -> Iterator[tuple[int, int]]:
    """The ports of a server of 1.0."""
    server = ServerOf10()
    try:
        yield server.ports
    finally:
        server.close()
