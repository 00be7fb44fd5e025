"""What a client on the IPC channel was told, what it answered, and what it still has."""

from __future__ import annotations

from dataclasses import dataclass, field

from splatbus_schemas import LIMITS
from splatbus_wire.messages import Frame, FrameCamera, Release

from splatbus_server.exchange import BOTH, Image
from splatbus_server.memory import FrameMemory

LET_GO_SECONDS: float = LIMITS["let_go_seconds"]


@dataclass
class Reader:
    """A client that was sent an init packet, or is to be sent one.

    Attributes:
        is_let_in: one of those who may hold an image [IMG-18].
        announced: memory by generation, from init packet to `open_failed` or `closed`.
        opened: the generations of these that it said it had opened.
        told: the newest generation that it was told of.
        told_at: when.
        wants: channels, from the newest `subscribe`.
        due: channels that it wanted when it began to wait for the next image, and may read of that.
        kept: those of `due` that it has wanted ever since.
        readable: those that it has wanted ever since it waited for the image lent last [IMG-25].
        lease: the image that it holds.
        shown: serial of the newest camera pose whose image it was sent.
    """

    is_let_in: bool = False
    announced: dict[int, FrameMemory] = field(default_factory=dict)
    opened: set[int] = field(default_factory=set)
    told: int = 0
    told_at: float = 0.0
    wants: frozenset[str] = BOTH
    due: frozenset[str] = BOTH
    kept: frozenset[str] = BOTH
    readable: frozenset[str] = BOTH
    lease: Image | None = None
    shown: int = 0

    def tell(self, memory: FrameMemory, now: float) -> None:
        """Notes that an init packet is sent."""
        self.announced[memory.generation] = memory
        self.told, self.told_at = memory.generation, now

    def open(self, generation: int) -> None:
        """Notes that it has opened a generation, and waits for an image of that."""
        if generation not in self.opened:  # to say it again changes nothing
            self.opened.add(generation)
            self.due = self.kept = self.wants

    def subscribe(self, channels: frozenset[str]) -> None:
        """Notes what it wants from now on."""
        self.wants = channels
        self.kept &= channels
        self.readable &= channels

    def take(self, image: Image) -> None:
        """Notes that it holds an image."""
        self.lease = image
        self.readable = self.kept

    def give_back(self) -> None:
        """Notes that it holds no image any more, and waits for the next."""
        self.lease = None
        self.due = self.kept = self.wants

    @property
    def needs(self) -> frozenset[str]:
        """The channels that the next image for it has to hold [IMG-20]."""
        return self.wants if self.lease is not None else self.wants | self.due

    @property
    def lacks(self) -> bool:
        """Whether it waits, and the image before lacked a channel for it [IMG-25]."""
        return self.lease is None and not self.wants <= self.readable

    @property
    def late_at(self) -> float | None:
        """When it is to be disconnected for former memory [VPT-8]; None if it has none."""
        has_former = any(generation < self.told for generation in self.announced)
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
