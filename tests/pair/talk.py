"""A client in raw sockets that says what a test has it say, and hears what it is sent."""

from __future__ import annotations

from typing import Any

from tests.pair.rig import MOST_SECONDS, Tap
from tests.peers.raw_client import CAPABILITIES, RawClient, Reader, hello

EVERYTHING = "intrinsics objects scene viewport time ping telemetry".split()


class Talker(RawClient):
    """A message connection that has received `welcome`."""

    def __init__(self, tap: Tap, *capabilities: str) -> None:
        super().__init__(tap.ports["msg"], timeout=MOST_SECONDS)
        welcome = self.ask(hello(*(capabilities or EVERYTHING)))
        assert welcome is not None
        assert welcome["type"] == "welcome", welcome
        self.granted = set(welcome["capabilities"])

    def until(self, kind: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """The next message of this type, and what came before it."""
        before = []
        while True:
            message = self.receive()
            assert message is not None, f"the connection ended before any {kind}"
            if message.get("type") == kind:
                return message, before
            before.append(message)

    def said_since(self) -> list[dict[str, Any]]:
        """Everything that the server has sent up to now: a ping comes after it, in order."""
        self.send({"type": "ping", "t": 0.0})
        return self.until("pong")[1]


class Onlooker(Reader):
    """A reader that can wait for an image of a certain kind, releasing all others."""

    def __init__(self, tap: Tap, *capabilities: str) -> None:
        super().__init__(tap.ports["ipc"], *(capabilities or CAPABILITIES))
        self.socket.settimeout(MOST_SECONDS)

    def see(self, wanted: Any) -> dict[str, Any]:
        """The first frame of which `wanted` is true; it has been released as well."""
        while True:
            frame = self.frame()
            self.release(frame)
            if wanted(frame):
                return frame


def object_pose(name: str, x: float = 0.0, **more: Any) -> dict[str, Any]:
    return {
        "type": "object_pose",
        "object": name,
        "position": {"x": x, "y": 0.0, "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        **more,
    }
