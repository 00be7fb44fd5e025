"""Of which pose an image of a server of 1.0 is: by the scene, or by another image of that pose.

1.0 names no camera of an image, and few show the scene of SCENE.md. Of any other, a pose that was
sent plainly tells how it looks from there; one that is spelt in another way has to look the same.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks.v1_0.acc.device import LegacyFrameCapture, lens_of
from splatbus_conformance.checks.v1_0.acc.servers import AT_ORIGIN
from splatbus_conformance.checks.v1_0.buf.servers_device import BufferContents
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import HardView, turned_about
from splatbus_conformance.images.pinhole import Camera, rigid
from splatbus_conformance.trials.controls import CAMERA_REQUEST
from splatbus_conformance.trials.moves.frame_capture import AT_REST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import finites
from splatbus_conformance.wire.messages import Json

UPRIGHT = AT_ORIGIN.rotation
LEFT, RIGHT = Pose((-0.5, 0.1, -0.75), UPRIGHT), Pose((0.75, -0.2, -1.0), UPRIGHT)
"""Cameras that see the scene of SCENE.md, and no image of the one is one of the other."""
ASKEW = Pose((-0.3, 0.15, -0.5), turned_about(UPRIGHT, (0.3, 0.5, 0.8), 0.2))
"""That its rotation was read with the scalar first shows, too: it looks the same way then."""
NOWHERE = Camera(rigid(*AT_ORIGIN), 1.0, 1.0, 0.0, 0.0, 1, 1, 0.01, 100.0)
"""For images whose lens is yet to be found."""
SLACK = 0.05
"""The share of the pixels by which poses are told apart that may be others in images of one pose:
the sums of a GPU come in any order."""
LEAST_PIXELS = 16
"""Fewer tell no poses apart."""
COLOR_STEP, DEPTH_STEP = 2 / 255, 1e-3


class PoseFrameCapture(LegacyFrameCapture):
    """Tells of which pose an image is, of a scene that stands still.

    Attributes:
        left, right, askew: cameras that look around where the server's first one is.
    """

    def __init__(
        self,
        trial: ServerTrial,
        read: Callable[[], BufferContents],
        before: "PoseFrameCapture | None" = None,
    ) -> None:
        """Begin; what was found out of an earlier run of the same server holds still."""
        super().__init__(trial, read, before.lens if before else NOWHERE)
        found = None if before else lens_of(self.at_origin())
        self.knows: bool = before.knows if before else found is not None
        self._plain: dict[HardView, BufferContents] = dict(before._plain) if before else {}
        self._at: Pose = before._at if before else AT_ORIGIN
        if not before:
            self.lens = found or NOWHERE
            self._at = AT_ORIGIN if self.knows else first_camera(trial)
        self.left, self.right, self.askew = (before_it(self._at, it) for it in (LEFT, RIGHT, ASKEW))

    def learn(self, *stages: HardView) -> None:
        """See how the scene looks from there, where that is not known; then look from elsewhere.

        Skips the check where poses that are far apart cannot be told apart.
        """
        for stage in () if self.knows else stages:
            if stage in self._plain:
                continue
            self._plain[stage] = self._stored(*stage)
            away = HardView(self.askew if stage.camera != self.askew else self.left, stage.scene)
            self._plain[away] = self._stored(*away)
            here, there = self._plain[stage], self._plain[away]
            if self._differs(here, there).sum() < LEAST_PIXELS:
                self.trial.not_observable(f"from {stage.camera} all looks as from {away.camera}")

    def shows(self, photograph: CapturedFrame, scene: Pose = AT_REST) -> bool:
        """Whether this is the scene from that camera, with the Gaussians there."""
        if self.knows:
            return super().shows(photograph, scene)
        stage = HardView(photograph.pose, scene)
        return self._is_like(BufferContents(photograph.color, photograph.depth), self._plain[stage])

    def comes_to_show(self, camera: Pose, scene: Pose, *spelled: Json) -> bool:
        """Whether the image that comes shows this, once it was told so, or was sent what is
        `spelled` in place of that.
        """
        stage = HardView(camera, scene)
        return self._comes_to_show((stage,), spelled) == stage

    def comes_to_show_one(self, *stages: HardView, by: Json) -> HardView | None:
        """Which of these the image shows that comes of a message, if any."""
        return self._comes_to_show(stages, (by,))

    def _comes_to_show(
        self, stages: tuple[HardView, ...], spelled: tuple[Json, ...]
    ) -> HardView | None:
        self.learn(*stages)

        def shown_by(stored: BufferContents) -> HardView | None:
            return next((it for it in stages if self._is_of(stored, it)), None)

        came = self._stored(*stages[0], *spelled, right=lambda it: shown_by(it) is not None)
        found = shown_by(came)
        if found is None and not self.knows:
            self._expect_still(stages[0])
        return found

    def _is_of(self, stored: BufferContents, stage: HardView) -> bool:
        return self.shows(self.photograph(stored, stage.camera), stage.scene)

    def _expect_still(self, stage: HardView) -> None:
        """The positive control: a pose that is sent once more looks as it did before."""
        former = self._plain[stage]
        away = self.right if stage.camera != self.right else self.left
        self._stored(away, stage.scene)
        if not self._is_like(self._stored(*stage), former):
            self.trial.not_observable("the scene moves by itself")

    def _is_like(self, stored: BufferContents, wanted: BufferContents) -> bool:
        """Most of the pixels that are others from elsewhere are those that are wanted."""
        telling = np.any([self._differs(it, wanted) for it in self._plain.values()], axis=0)
        return bool(self._differs(stored, wanted).sum() <= SLACK * telling.sum())

    def _differs(self, some: BufferContents, others: BufferContents) -> NDArray[np.bool_]:
        """(h, w): pixels that hold something else, whatever the rounding."""
        color = np.isclose(some.color, others.color, rtol=0, atol=COLOR_STEP, equal_nan=True)
        depth = np.isclose(some.depth, others.depth, rtol=DEPTH_STEP, atol=0, equal_nan=True)
        found: NDArray[np.bool_] = ~(color.all(axis=-1) & depth)
        return found


def first_camera(trial: ServerTrial) -> Pose:
    """The first that the scene comes with; the origin where the server tells none."""
    reply = trial.ask(trial.dial("msg"), CAMERA_REQUEST) or {}
    position, rotation = finites(reply.get("position"), 3), finites(reply.get("rotation"), 4)
    return Pose(position, rotation) if position and rotation and any(rotation) else AT_ORIGIN


def before_it(at: Pose, pose: Pose) -> Pose:
    """A pose in the axes of a camera, in those of the world."""
    place = rigid(*at).place(np.array(pose.position))
    *axis, w = pose.rotation
    turn = 2.0 * float(np.arctan2(np.linalg.norm(axis), w))
    rotation = turned_about(at.rotation, axis, turn)
    return Pose(tuple(map(float, place)), rotation)
