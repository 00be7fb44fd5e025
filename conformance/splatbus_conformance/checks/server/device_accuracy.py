"""Checks on how exactly a server of 1.0 renders the scene of SCENE.md (spec 1.0 chapter 8).

1.0 does not say with which camera an image was rendered. So the camera is where it was put, and the
lens is found from the image of one at the origin, where no digits are lost.
"""

import time
from collections.abc import Callable

import numpy as np

from splatbus_conformance.checks import check
from splatbus_conformance.checks.server.accuracy import (
    AT_ORIGIN,
    Registered,
    expect_centres,
    expect_no_shear,
    expect_rotations,
    registered,
)
from splatbus_conformance.checks.server.device_images import Stored, reading
from splatbus_conformance.lens_finding import find_lens
from splatbus_conformance.memory_reading import Pixels
from splatbus_conformance.messages import Json, camera_pose
from splatbus_conformance.nudging import AGAIN_SECONDS
from splatbus_conformance.photographer import AT_REST, aside
from splatbus_conformance.photographs import LEGACY_EMPTY, Photograph, shows_the_scene
from splatbus_conformance.pinhole import Camera, Reals, rigid
from splatbus_conformance.server_trial import ServerTrial
from splatbus_conformance.stress import Pose
from splatbus_conformance.trial import EFFECT_SECONDS

SHOWN = ("cuda", "device")
REGISTERED = "the camera that images of a known scene in CUDA memory were rendered with"
GLANCE_SECONDS = 0.02
SETTLED_SECONDS, TIMES = 0.1, 3.0
"""An image is taken for the one of a pose that has not changed for so long, and for so many times
as long as it took to change."""


class LegacyPhotographer:
    """Moves the camera of a server of 1.0, and reads what comes of it.

    Attributes:
        lens: the camera of an image at the origin.
    """

    def __init__(self, trial: ServerTrial, read: Callable[[], Stored]) -> None:
        """Begin; skips the check where the server does not show the scene that is known."""
        self.trial = trial
        self._read = read
        self._pace = 0.0
        self._last: Stored | None = None
        self._stored(aside(AT_ORIGIN), AT_REST)
        color, depth = self._stored(AT_ORIGIN, AT_REST)
        found = find_lens(rigid(*AT_ORIGIN), _planar(depth))
        if found is None or not shows_the_scene(_photograph(found, AT_ORIGIN, color, depth)):
            trial.not_observable("the server does not show the scene of conformance/SCENE.md")
        self.lens: Camera = found

    def take(self, camera: Pose, scene: Pose) -> Photograph:
        """What the server stores for a camera, with the Gaussians there."""
        return _photograph(self.lens, camera, *self._stored(camera, scene))

    def _stored(self, camera: Pose, scene: Pose) -> Stored:
        """The image that comes of these poses, once it stays; the requirement is violated if none
        does. Skips the check where images change all the time.
        """
        began = changed = time.monotonic()
        sent, former, now = 0.0, self._last, self._read()
        while time.monotonic() - began < EFFECT_SECONDS and not self.trial.fate():
            if time.monotonic() - sent >= AGAIN_SECONDS:
                self.trial.move(camera_pose(*scene, kind="point_cloud_pose"))
                self.trial.move(camera_pose(*camera))
                sent = time.monotonic()
            self.trial.rest(GLANCE_SECONDS)
            before, now = now, self._read()
            if not _same(before, now):
                changed = time.monotonic()
                self._pace = max(self._pace, changed - began)
            settled = time.monotonic() - changed > max(SETTLED_SECONDS, TIMES * self._pace)
            if settled and (former is None or not _same(former, now)):
                break
        else:
            what = f"no image in CUDA memory came of the camera at {camera}"
            self.trial.expect(former is None or not _same(former, now), what)
            self.trial.not_observable("its images change all the time")
        self._last = now
        self.trial.delivered += 1
        return now


def _same(some: Stored, others: Stored) -> bool:
    return all(a.tobytes() == b.tobytes() for a, b in zip(some, others, strict=True))


def _planar(depth: Pixels) -> Reals:
    covered = np.isfinite(depth) & (depth > 0) & (depth != LEGACY_EMPTY)
    return np.where(covered, depth, np.inf).astype(np.float64)


def _photograph(lens: Camera, at: Pose, color: Pixels, depth: Pixels) -> Photograph:
    named: Json = {"position": list(at.position), "rotation": list(at.rotation)}
    camera = lens._replace(pose=rigid(*at))
    return Photograph({"seq": 0, "camera": named}, camera, color, depth, {})


def taking(trial: ServerTrial, farthest: float, full: int) -> Registered:
    """The camera of each image in CUDA memory, as the image has it."""
    with reading(trial) as read:
        photographer = LegacyPhotographer(trial, read)
        yield from registered(trial, farthest, 2, full, photographer.take)


@check("ACC-2", observable=REGISTERED, needs=SHOWN)
def check_rotations_in_device_memory_are_those_of_the_quaternion(trial: ServerTrial) -> None:
    """Quaternions of norms from 0.9905 to 1.0095, half-turns, and next to the identity."""
    expect_rotations(trial, taking(trial, 1.0, 100))


@check("ACC-3", observable=REGISTERED, needs=SHOWN)
def check_rotations_in_device_memory_do_not_shear(trial: ServerTrial) -> None:
    """‖RᵀR − I‖₂ of the matrix that the image was rendered with."""
    expect_no_shear(trial, taking(trial, 1.0, 100))


@check("ACC-5", observable=REGISTERED, needs=SHOWN)
def check_the_camera_in_device_memory_is_where_it_was_put(trial: ServerTrial) -> None:
    """The camera's centre, as the image has it, up to 10,000 units from the origin."""
    expect_centres(trial, taking(trial, 1e4, 100))


@check("ACC-6", observable=REGISTERED, needs=SHOWN)
def check_single_precision_in_device_memory_is_rounded_once(trial: ServerTrial) -> None:
    """Cameras up to 100,000 units from the origin, where each digit that was lost is seen."""
    expect_centres(trial, taking(trial, 1e5, 100))
