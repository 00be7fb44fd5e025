"""Clients that the harness plays in a session with a server, and what is known of each."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from splatbus_conformance.rules import Breach
from splatbus_conformance.wire.json_values import finite, within
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

VIEWPORT = -1
"""Asks for the viewport's size; any other number for the camera of that index."""


@dataclass(eq=False)
class Asker:
    """A client on the message channel."""

    seat: int
    connection: Connection
    asked: list[int] = field(default_factory=list)
    """What each request was for."""
    camera: float | None = None
    """Where it would have the camera."""
    half: bytes = b""
    """The rest of a packet that it has begun."""

    def request(self, what: int) -> Json:
        """The next request."""
        self.asked.append(what)
        if what == VIEWPORT:
            return {"type": "get_viewport_size"}
        return {"type": "get_camera_pose", "cam_idx": what}

    def wrong(self, replies: Sequence[Json], cameras: Sequence[Json | None]) -> Breach | None:
        """What is wrong with the replies so far: their number, their kinds, their order."""
        if len(replies) > len(self.asked):
            counts = f"{len(replies)} replies to {len(self.asked)} requests"
            return Breach("unasked-reply", f"message client {self.seat} was sent {counts}")
        for number, (reply, what) in enumerate(zip(replies, self.asked, strict=False), 1):
            if what == VIEWPORT:
                fits = "viewport_size" in reply
            else:
                fits = "position" in reply and cameras[what] in (None, pose_of(reply))
            if not fits:
                text = f"reply {number} to message client {self.seat} answers another request"
                return Breach("out-of-order", text)
        return None


@dataclass(eq=False)
class Reader:
    """A client on the IPC channel."""

    seat: int
    connection: Connection
    keeps: bool = False
    """It does not release what it is lent."""
    held: Json | None = None
    """The frame that it keeps."""
    frames: int = 0
    camera: float | None = None
    """Where the camera was, of the last frame."""
    half: bytes = b""

    def show(self, frame: Json) -> None:
        """Take a frame."""
        self.frames += 1
        self.camera = finite(within(frame, "camera", "position", 0))


def pose_of(reply: Json) -> Json:
    """The camera that a reply tells."""
    return {name: reply.get(name) for name in ("position", "rotation")}
