"""The images of a server, wherever they lie: one that lends frames, or stores in CUDA memory.

What can be seen differs. A frame names the camera of its image, and 1.0 names none. The checks that
judge both ask a `Gallery` for images, and a `Steering` which pose is in force.
"""

import contextlib
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Protocol

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.reprojection import Misreading
from splatbus_conformance.trials.moves import survey
from splatbus_conformance.trials.moves.camera_control import CameraControl, camera_of
from splatbus_conformance.trials.moves.device_gallery import (
    DeviceGallery,
    DeviceSteering,
    reading,
)
from splatbus_conformance.trials.moves.frame_capture import FrameCapture
from splatbus_conformance.trials.moves.resizing import (
    REINIT_SECONDS,
    RESIZES,
    asked_again,
    other_sizes,
    resizing,
    size_of,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

ROTATION = (0.1, 0.3, 0.5, 0.8062257748298549)
"""No two of its parts are the same, so that none can be taken for another unseen."""


class Gallery(Protocol):
    """The images that a server shows."""

    legacy: bool
    """They are those of 1.0: none comes fast, and its colour and depth may be of two images."""

    def some(self) -> Iterator[CapturedFrame]:
        """Images from several cameras."""

    def take(self, camera: Pose, scene: Pose) -> CapturedFrame:
        """What the server shows for a camera, with the Gaussians there."""

    def judge(self, wrong: Sequence[Misreading], *scales: float) -> None:
        """The requirement is violated if images fit one of these wrong readings, and not what they
        should; skips the check where they tell nothing.

        Args:
            wrong: of what is stored, or of the pose that was sent.
            scales: how far the camera is moved, one after the other.
        """


class HostGallery:
    """The images that a server of 1.1 lends."""

    legacy = False

    def __init__(self, trial: ServerTrial) -> None:
        self.trial = trial

    @cached_property
    def _capture(self) -> FrameCapture:
        return FrameCapture(self.trial)

    def some(self) -> Iterator[CapturedFrame]:
        """The first image, some from around it, and one of another size, where there is one."""
        first = survey.first_view(self.trial)
        yield first
        around = survey.moves(first)
        for pose in around if self.trial.thorough else around[::3]:
            yield self._capture.take(pose)
        yield from self._resized(around[0])

    def _resized(self, camera: Pose) -> list[CapturedFrame]:
        """An image of another size from there, if the server has one; then it is as it was."""
        trial = self.trial
        if any(map(trial.facts.lacks, RESIZES)):
            return []
        trial.peer.close_all()
        size = other_sizes(trial)[1]
        with resizing(trial) as client:
            capture = FrameCapture(trial)
            if asked_again(trial, client, size, "busy") != "viewport_size":
                return []
            packets = capture.dealings.init_packets
            trial.wait(lambda: size_of(packets[-1]) == size, REINIT_SECONDS)
            return [capture.take(camera)]

    def take(self, camera: Pose, scene: Pose) -> CapturedFrame:
        """The image of a frame that names this camera."""
        return self._capture.take(camera, scene)

    def judge(self, wrong: Sequence[Misreading], *scales: float) -> None:
        """By which reading images from around the first view fit one another."""
        survey.judge_readings(self.trial, wrong, *scales)


@contextlib.contextmanager
def gallery(trial: ServerTrial, place: str) -> Iterator[Gallery]:
    """The images in that memory."""
    if place == "host":
        yield HostGallery(trial)
    else:
        with reading(trial) as read:
            yield DeviceGallery(trial, read)


class Steering(Protocol):
    """Moves the camera of a server, and sees which pose is in force.

    Attributes:
        left, right, askew: cameras that are told apart by what is seen.
    """

    left: Pose
    right: Pose
    askew: Pose

    def put(self, camera: Pose, code: str = "not-applied", by: Connection | None = None) -> None:
        """Send a pose, as viewers do, until it is in force; the requirement is violated if it is
        not in time.

        Args:
            camera: where the camera is to be.
            code: of the violation.
            by: the connection that is in control from now on; that of before is closed.
        """

    def takes(self, camera: Pose, *spelled: Json) -> str:
        """What becomes of a pose that is `spelled` so: `accepts`, `ignores`, or what the server did
        instead; of several it is the last.
        """

    def keeps(self) -> bool:
        """Move the Gaussians, so that an image is due: whether the camera is where it was put."""

    def outcome_of(self, payload: bytes, there: Pose | None = None) -> str:
        """What becomes of what must not move the camera, or moves it there and nowhere else, from
        the connection in control: `keeps`, `accepts`, `applies`, or what the server did instead.
        """

    def where(self) -> str:
        """What is known of the camera now, for whoever reads of it."""


class HostSteering:
    """By the cameras that frames name."""

    left, right, askew = (
        Pose((0.25, 0.5, -0.75), ROTATION),
        Pose((1.5, 2.5, -3.5), ROTATION),
        Pose((30.5, -20.25, 10.125), (0.5, -0.5, 0.5, 0.5)),
    )

    def __init__(self, trial: ServerTrial) -> None:
        self.trial = trial
        self._control = CameraControl(trial)
        self._at, self._since = camera_of(camera_pose()), 0

    def put(self, camera: Pose, code: str = "not-applied", by: Connection | None = None) -> None:
        """As `Steering` has it."""
        if by:
            self.trial.pass_control(by)
        pose = camera_pose(*camera)
        shown = self._control.shows(self.trial.mover(), pose)
        self.trial.expect(shown, code, f"no frame shows a camera at {camera}; {self.where()}")
        self._at, self._since = camera_of(pose), self._control.count

    def takes(self, camera: Pose, *spelled: Json) -> str:
        """As `Steering` has it."""
        mover = self.trial.mover()
        mover.send(b"".join(packet(encode(each)) for each in spelled))
        if not self._control.renders_for(mover):
            return self.trial.fate() or ("closes" if mover.ended else "hangs")
        return "accepts" if self._control.shows_now(camera_pose(*camera)) else "ignores"

    def keeps(self) -> bool:
        """As `Steering` has it."""
        seen = self._control.nudged(self.trial.mover(), self._since)
        return all(camera.shows(self._at) for camera in seen)

    def outcome_of(self, payload: bytes, there: Pose | None = None) -> str:
        """As `Steering` has it."""
        outcome = self._control.outcome_of(self.trial.mover(), payload)
        moved = outcome == "applies" and there and self._control.shows_now(camera_pose(*there))
        return "accepts" if moved else outcome

    def where(self) -> str:
        """As `Steering` has it."""
        return f"the camera is at {self._control.now()}"


@contextlib.contextmanager
def steering(trial: ServerTrial, place: str) -> Iterator[Steering]:
    """Who sees it by that memory."""
    if place == "host":
        yield HostSteering(trial)
    else:
        with reading(trial) as read:
            yield DeviceSteering(trial, read)
