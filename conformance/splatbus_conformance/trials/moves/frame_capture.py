"""Has a server render for cameras that the harness chose, and copies the images that it lends."""

import time
from typing import Any

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.captured import CapturedFrame, photograph_of
from splatbus_conformance.images.reprojection import AS_SPECIFIED, named
from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.moves.nudging import AGAIN_SECONDS
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.messages import Json, camera_pose

MISTAKEN_SECONDS = 1.0
"""How long a frame with the right camera may take to follow one that could be a mistaken one."""
ASIDE = 0.01
"""How far something is moved aside, so that an image from where it was can be told to be new."""
AT_REST = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class FrameCapture:
    """Moves the camera and the Gaussians, and reads what the server makes of it."""

    def __init__(self, trial: ServerTrial) -> None:
        self.trial = trial
        self.began = time.monotonic()
        trial.viewer.releases = False
        self.reader = trial.reading()
        self.dealings = trial.with_(self.reader)
        self._seen = 0
        trial.wait(lambda: self._came() or self.reader.ended)
        self._last: CapturedFrame | None = None
        self.new()

    def take(
        self, camera: Pose, scene: Pose | None = AT_REST, *, insists: bool = True, **members: Any
    ) -> CapturedFrame:
        """What the server shows for a camera, with the Gaussians as `scene` says, or where they
        were if that is None; `members` are added to the pose of the camera.

        While no such image comes, both poses are sent again, as viewers do; or, if it does not
        insist, the Gaussians are moved a little, so that an image is due.

        Where no frame names that camera, it is the last one that came; the requirement is violated
        if there is none, or the server ends the connection.
        """
        if self._last and named(self._last.camera.pose, camera) is AS_SPECIFIED:
            self.take(aside(camera), scene)
        clock = self.trial.peer.clock
        last, sent, until = None, None, clock() + EFFECT_SECONDS
        while clock() < until and not (self.reader.ended or self.trial.fate()):
            if sent is None or clock() - sent >= AGAIN_SECONDS:
                if scene is not None:
                    self._place(scene if insists or sent is None else aside(scene))
                if insists or sent is None:
                    self.go(camera, **members)
                sent = clock()
            self.trial.wait(self._came, AGAIN_SECONDS)
            for last in self.new():
                meant = named(last.camera.pose, camera)
                if meant is AS_SPECIFIED:
                    return last
                patience = EFFECT_SECONDS if meant is None else MISTAKEN_SECONDS
                until = min(until, clock() + patience)
        if last is None or self.reader.ended:
            did = "closed its reader's connection" if self.reader.ended else "sent no frame"
            fell_silent(
                self.trial, self.reader, f"the server {did} after the camera had been moved"
            )
        return last

    @property
    def slots(self) -> int:
        """How many images the ring holds."""
        return self.dealings.memory.layout.slots if self.dealings.memory else 0

    def go(self, camera: Pose, **members: Any) -> None:
        """Send a camera, and wait for nothing."""
        self.trial.move(camera_pose(*camera) | members)

    def hold(self) -> CapturedFrame:
        """The next image, not given back; the requirement is violated if none comes."""
        self.trial.wait(lambda: self._came() or self.reader.ended)
        if not self._came():
            fell_silent(self.trial, self.reader, "the server sent no further frame")
        photograph = self._copy(self.dealings.frames[self._seen])
        self._seen += 1
        if photograph is None:
            self.trial.not_observable("the server sent a frame that cannot be read")
        return photograph

    def again(self, photograph: CapturedFrame) -> CapturedFrame:
        """What lies in the slot of an image that is held still."""
        copy = self._copy(photograph.frame)
        if copy is None:
            self.trial.not_observable("the server has announced other memory")
        return copy

    def give_back(self, photograph: CapturedFrame, *more: Json) -> None:
        """Release an image that was held, and say more in the same write."""
        self.trial.viewer.release(self.reader, photograph.frame, *more)

    def new(self) -> list[CapturedFrame]:
        """Copies of the images that came since, which are given back."""
        found = []
        while self._came():
            frame = self.dealings.frames[self._seen]
            self._seen += 1
            if (photograph := self._copy(frame)) is not None:
                found.append(photograph)
                self._last = photograph
            self.trial.viewer.release(self.reader, frame)
        return found

    def stay(self, seconds: float) -> list[CapturedFrame]:
        """The images of a camera that is not moved for so many seconds."""
        until, found = time.monotonic() + seconds, list[CapturedFrame]()
        while (left := until - time.monotonic()) > 0 and not self.reader.ended:
            self.trial.wait(self._came, left)
            found += self.new()
        return found

    def _place(self, scene: Pose) -> None:
        self.trial.move(camera_pose(*scene, kind="point_cloud_pose"))

    def _came(self) -> bool:
        return len(self.dealings.frames) > self._seen

    def _copy(self, frame: Json) -> CapturedFrame | None:
        if self.dealings.memory is None or not self.dealings.init_packets:
            return None
        init_packet = self.dealings.init_packets[-1]
        photograph = photograph_of(frame, self.dealings.memory, init_packet)
        self.trial.last_image = photograph or self.trial.last_image
        return photograph


def aside(pose: Pose) -> Pose:
    """A pose next to another one."""
    x, y, z = pose.position
    return Pose((x + ASIDE * max(1.0, abs(x)), y, z), pose.rotation)
