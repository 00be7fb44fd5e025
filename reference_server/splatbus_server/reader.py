"""What a client on the IPC channel was told, what it answered, and what it still has."""

from __future__ import annotations

from dataclasses import dataclass, field

from splatbus_schemas import LIMITS
from splatbus_wire.messages import Frame, FrameCamera, Release

from splatbus_server.exchange import BOTH, Image
from splatbus_server.memory import FrameMemory

LET_GO_SECONDS: float = LIMITS["let_go_seconds"]
ANSWER_SECONDS: float = LIMITS["free_seconds"] / 2
"""How long former memory is kept for a client that has not said whether it opened it: it may be
about to, and an error is a poor answer; but who says nothing must not keep it [VPT-7]."""


@dataclass
class Reader:
    """A client that was sent an init packet, or is to be sent one.

    Attributes:
        announced: memory by generation, from init packet to `open_failed` or `closed`.
        opened: the generations of these that it said it had opened.
        told: the newest generation that it was told of.
        told_at: when.
        wants: channels, from `subscribe`.
        lease: the image that it holds.
        shown: serial of the newest camera pose whose image it was sent.
    """

    announced: dict[int, FrameMemory] = field(default_factory=dict)
    opened: set[int] = field(default_factory=set)
    told: int = 0
    told_at: float = 0.0
    wants: frozenset[str] = BOTH
    lease: Image | None = None
    shown: int = 0

    def tell(self, memory: FrameMemory, now: float) -> None:
        """Notes that an init packet is sent."""
        self.announced[memory.generation] = memory
        self.told, self.told_at = memory.generation, now

    @property
    def answers_by(self) -> float:
        """How long former memory is kept for it that it has not answered."""
        return self.told_at + ANSWER_SECONDS

    @property
    def late_at(self) -> float | None:
        """When it is to be disconnected for former memory that it opened [VPT-8]; or None."""
        has_former = any(generation < self.told for generation in self.opened)
        return self.told_at + LET_GO_SECONDS if has_former else None

    def frame(self, image: Image) -> Frame:
        """What tells it of an image: with the tag of a pose that it sees for the first time."""
        view, poses = image.view, image.view.poses
        tag = poses.tag if poses.serial > self.shown else None  # CAM-2, CAM-3
        self.shown = max(self.shown, poses.serial)
        fx, fy, cx, cy, near, far = view.intrinsics
        size = view.width, view.height
        return Frame(
            image.memory.generation,
            image.seq,
            image.slot,
            FrameCamera(poses.camera, fx, fy, cx, cy, *size, near, far, tag),
            image.time,
            image.rendered_at,
            poses.moved_objects,
        )


def receipt(image: Image) -> Release:
    """What a client sends to give the image back."""
    return Release(image.memory.generation, image.seq)
