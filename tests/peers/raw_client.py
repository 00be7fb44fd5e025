"""A client in raw sockets and JSON, that can also be rude."""

from __future__ import annotations

import json
import mmap
import os
import socket
import struct
import sys
from types import TracebackType
from typing import Any, Self

import numpy as np

LINGER = "hh" if sys.platform == "win32" else "ii"
CAPABILITIES = ["host_shm", "frames", "reinit", "subscribe"]
IDENTITY = {"position": {"x": 0, "y": 0, "z": 0}, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}


def packet(message: Any) -> bytes:
    """A message as bytes; bytes go out as they are, under a right header."""
    payload = message if isinstance(message, bytes) else json.dumps(message).encode()
    return struct.pack("<I", len(payload)) + payload


def camera_pose(x: float = 0.0, **other: Any) -> dict[str, Any]:
    position = {"x": x, "y": 0.0, "z": 0.0}
    return {"type": "camera_pose", **IDENTITY, "position": position, **other}


def hello(*capabilities: str, **other: Any) -> dict[str, Any]:
    return {
        "type": "hello",
        "versions": ["1.1", "1.0"],
        "client": {"name": "raw", "version": "0"},
        "capabilities": list(capabilities),
        **other,
    }


def packets(data: bytes) -> list[dict[str, Any]]:
    """The messages in whole packets."""
    messages = []
    while data:
        end = 4 + int.from_bytes(data[:4], "little")
        messages.append(json.loads(data[4:end]))
        data = data[end:]
    return messages


class End:
    """One end of a connection; every wait has a limit."""

    def __init__(self, connection: socket.socket, seconds: float) -> None:
        self.socket = connection
        self.socket.settimeout(seconds)
        self._buffer = b""

    def close(self) -> None:
        self.socket.close()

    def reset(self) -> None:
        """Closes with a reset in place of an end of stream."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack(LINGER, 1, 0))
        self.socket.close()

    def send(self, *messages: Any) -> None:
        self.socket.sendall(b"".join(map(packet, messages)))

    def receive(self) -> dict[str, Any] | None:
        """The next message; None at the end of the stream, however it comes."""
        while len(self._buffer) < 4 or len(self._buffer) < 4 + self._length():
            try:
                data = self.socket.recv(65536)
            except ConnectionError:
                data = b""
            if not data:
                return None
            self._buffer += data
        end = 4 + self._length()
        payload, self._buffer = self._buffer[4:end], self._buffer[end:]
        message = json.loads(payload)
        assert isinstance(message, dict)
        return message

    def _length(self) -> int:
        (length,) = struct.unpack_from("<I", self._buffer)
        assert isinstance(length, int)
        return length


class RawClient(End):
    """One connection to a server."""

    def __init__(self, port: int, host: str = "127.0.0.1", timeout: float = 10.0) -> None:
        super().__init__(socket.create_connection((host, port), timeout=timeout), timeout)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def ask(self, message: Any) -> dict[str, Any] | None:
        self.send(message)
        return self.receive()

    def viewport(self) -> list[int]:
        """What is there to see: proof that the server serves this connection."""
        reply = self.ask({"type": "get_viewport_size"})
        assert reply is not None, "the server closed the connection"
        size: list[int] = reply["viewport_size"]
        return size

    def silent(self, seconds: float) -> bool:
        """Whether nothing comes within a time, neither bytes nor an end."""
        self.socket.settimeout(seconds)
        try:
            return not self._buffer and self.socket.recv(1, socket.MSG_PEEK) is None
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(10.0)


class Reader(RawClient):
    """A client of 1.1 on the IPC channel: opens the memory, takes and returns images."""

    def __init__(self, port: int, *capabilities: str, **other: Any) -> None:
        super().__init__(port)
        self.send(hello(*(capabilities or CAPABILITIES), **other))
        welcome = self.receive()
        assert welcome is not None
        assert welcome["type"] == "welcome"
        self.welcome = welcome

    def open(self) -> dict[str, Any]:
        """Awaits an init packet, maps what it names, and says so."""
        init = self.receive()
        assert init is not None
        assert "meta" in init, init
        self.init = init
        self.memory = map_memory(init)
        self.send({"type": "opened", "generation": init["generation"]})
        return init

    def frame(self) -> dict[str, Any]:
        frame = self.receive()
        assert frame is not None
        assert frame["type"] == "frame", frame
        return frame

    def release(self, frame: dict[str, Any]) -> None:
        self.send({"type": "release", "generation": frame["generation"], "seq": frame["seq"]})

    def color(self, frame: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float32]]:
        """(height, width, 4), bottom row first; a view of the slot."""
        return self._slot(frame, "color", 4)

    def depth(self, frame: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float32]]:
        """(height, width), bottom row first; a view of the slot."""
        return self._slot(frame, "depth", 1)[..., 0]

    def _slot(
        self, frame: dict[str, Any], what: str, channels: int
    ) -> np.ndarray[Any, np.dtype[np.float32]]:
        ring, width, height = self.init["ring"], self.init["meta"]["w"], self.init["meta"]["h"]
        offset = ring[f"{what}Offset"] + frame["slot"] * ring[f"{what}Stride"]
        count = width * height * channels
        values = np.frombuffer(self.memory, np.float32, count, offset)
        return values.reshape(height, width, channels)


def map_memory(init: dict[str, Any]) -> mmap.mmap:
    name, size = init["memory"]["name"], init["memory"]["bytes"]
    if sys.platform == "win32":
        return mmap.mmap(-1, size, tagname=f"Local\\{name}", access=mmap.ACCESS_READ)
    if sys.platform == "linux":
        file = os.open(f"/dev/shm/{name}", os.O_RDONLY)
    else:
        from _posixshmem import shm_open

        file = shm_open(f"/{name}", os.O_RDONLY, 0)
    try:
        return mmap.mmap(file, size, access=mmap.ACCESS_READ)
    finally:
        os.close(file)
