"""Checks on how exactly a server of 1.0 renders the scene of SCENE.md (spec 1.0 chapter 8).

1.0 does not say with which camera an image was rendered. So the camera is where it was put, and the
lens is found from the image of one at the origin, where no digits are lost.
"""

import time
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.checks.v1_0.acc.servers import (
    AT_ORIGIN,
    Registered,
    expect_centres,
    expect_no_shear,
    expect_rotations,
    expect_translations,
    registered,
)
from splatbus_conformance.checks.v1_0.buf.servers_device import BufferContents, reading
from splatbus_conformance.images.captured import LEGACY_EMPTY, CapturedFrame, shows_the_scene
from splatbus_conformance.images.known_scene import SceneState
from splatbus_conformance.images.lens_finding import find_lens
from splatbus_conformance.images.memory.reading import Pixels
from splatbus_conformance.images.pinhole import Camera, ObjectPlacement, Reals, rigid
from splatbus_conformance.trials.moves.frame_capture import AT_REST, aside
from splatbus_conformance.trials.moves.nudging import AGAIN_SECONDS
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet

SHOWN = ("cuda", "device")
REGISTERED = "the camera that images of a known scene in CUDA memory were rendered with"
BESIDE = aside(aside(AT_ORIGIN))
"""What shows that images do come of poses, where one does not."""
UNKNOWN_SCENE = "the server does not show the scene of conformance/SCENE.md"
GLANCE_SECONDS = 0.02
SETTLED_SECONDS, TIMES, MOST_SECONDS = 0.1, 3.0, 1.5
"""An image is taken for the one of a pose that has not changed for so long, and for so many times
as long as it took to change, up to so long."""
RESTLESS = 20
"""Images that change so often after a pose change by themselves."""
Right = Callable[[BufferContents], bool]
"""Whether an image is one that was waited for."""


class LegacyFrameCapture:
    """Moves the camera of a server of 1.0, and reads what comes of it.

    Attributes:
        lens: the camera of an image at the origin.
    """

    def __init__(
        self, trial: ServerTrial, read: Callable[[], BufferContents], lens: Camera | None = None
    ) -> None:
        """Begin; skips the check where the server does not show the scene that is known, if the
        lens is not known.
        """
        self.trial = trial
        self._read = read
        self._pace = 0.0
        self._last = read()
        found = lens or lens_of(self.at_origin())
        if found is None:
            trial.not_observable(UNKNOWN_SCENE)
        self.lens: Camera = found

    def at_origin(self) -> BufferContents:
        """The image of a camera at the origin."""
        self._stored(aside(AT_ORIGIN), AT_REST)
        return self._stored(AT_ORIGIN, AT_REST)

    def seen_from(self, camera: Pose, photograph: CapturedFrame) -> CapturedFrame:
        """The same image, if it is one of this camera."""
        return _photograph(self.lens, camera, photograph.color, photograph.depth)

    def shows(self, photograph: CapturedFrame, scene: Pose = AT_REST) -> bool:
        """Whether this is the scene that is known, with the Gaussians there."""
        return shows_the_scene(photograph, SceneState(ObjectPlacement(rigid(*scene))))

    def take(
        self, camera: Pose, scene: Pose, *spelled: Json, right: Right | None = None
    ) -> CapturedFrame:
        """What the server stores for a camera, with the Gaussians there, once it was told so, or
        was sent what is `spelled` in place of that.

        Where it is told what is `right`, it gives the server time until an image is, for one that
        comes before may have been begun when not all had arrived.
        """
        return self.photograph(self._stored(camera, scene, *spelled, right=right), camera)

    def photograph(self, stored: BufferContents, camera: Pose) -> CapturedFrame:
        """An image, as one of this camera."""
        return _photograph(self.lens, camera, *stored)

    def _stored(
        self, camera: Pose, scene: Pose, *spelled: Json, right: Right | None = None
    ) -> BufferContents:
        """The image that comes of these poses, once it stays; the requirement is violated if none
        does, and one of another camera did that was sent in between.
        """
        said = spelled or _said(camera, scene)
        came, shown = self._comes(said, right), False
        if came is None:
            shown = self._comes(_said(BESIDE, AT_REST)) is not None
            came = self._comes(said, right)
        if came is None:
            what = f"no image in CUDA memory came of the camera at {camera}"
            self.trial.expect(not shown, "no-image", what)
            self.trial.not_observable(what)
        self.trial.delivered += 1
        return came

    def _comes(self, said: Sequence[Json], right: Right | None = None) -> BufferContents | None:
        """The image that comes of this, once it stays and is right, if one does in time; else the
        one that has come. Skips the check where images change all the time.
        """
        self._pace /= 2.0  # it was held up once, perhaps
        began = changed = time.monotonic()
        changes, sent, former, now = 0, 0.0, self._last, self._read()
        looked_at = 0.0
        while time.monotonic() - began < EFFECT_SECONDS and changes < RESTLESS:
            if time.monotonic() - sent >= AGAIN_SECONDS:
                # In one piece, so that hardly an image is begun when half of it has arrived.
                self.trial.mover().send(b"".join(packet(encode(message)) for message in said))
                sent = time.monotonic()
            self.trial.rest(GLANCE_SECONDS)
            before, now = now, self._read()
            if not _same(before, now):
                changes, changed = changes + 1, time.monotonic()
                self._pace = max(self._pace, changed - began)
            lasts = min(max(SETTLED_SECONDS, TIMES * self._pace), MOST_SECONDS)
            settled = time.monotonic() - changed > (lasts if right is None else SETTLED_SECONDS)
            if settled and looked_at != changed and not _same(former, now):
                if right is None or right(now):
                    break
                looked_at = changed
        else:
            if _same(former, now):
                return None
            if not looked_at or changes >= RESTLESS:
                self.trial.not_observable("its images change all the time")
        self._last = now
        return now


def _said(camera: Pose, scene: Pose) -> tuple[Json, Json]:
    return camera_pose(*scene, kind="point_cloud_pose"), camera_pose(*camera)


def lens_of(stored: BufferContents) -> Camera | None:
    """The lens of an image of a camera at the origin, if that shows the scene that is known."""
    planar = _planar(stored.depth)
    found = _searched(planar.tobytes(), planar.shape)
    known = found and shows_the_scene(_photograph(found, AT_ORIGIN, *stored))
    return found if known else None


@lru_cache(maxsize=4)
def _searched(planar: bytes, shape: tuple[int, ...]) -> Camera | None:
    """Once for an image that check after check looks at."""
    return find_lens(rigid(*AT_ORIGIN), np.frombuffer(planar).reshape(shape))


def _same(some: BufferContents, others: BufferContents) -> bool:
    return all(a.tobytes() == b.tobytes() for a, b in zip(some, others, strict=True))


def _planar(depth: Pixels) -> Reals:
    covered = np.isfinite(depth) & (depth > 0) & (depth != LEGACY_EMPTY)
    return np.where(covered, depth, np.inf).astype(np.float64)


def _photograph(lens: Camera, at: Pose, color: Pixels, depth: Pixels) -> CapturedFrame:
    named: Json = {"position": list(at.position), "rotation": list(at.rotation)}
    camera = lens._replace(pose=rigid(*at))
    return CapturedFrame({"seq": 0, "camera": named}, camera, color, depth, {})


def taking(trial: ServerTrial, farthest: float, full: int) -> Registered:
    """The camera of each image in CUDA memory, as the image has it."""
    with reading(trial) as read:
        capture = LegacyFrameCapture(trial, read)
        yield from registered(trial, farthest, 2, full, capture.take)


@check("ACC-2", observable=REGISTERED, on={SERVER: SHOWN})
def check_rotations_in_device_memory_are_those_of_the_quaternion(trial: ServerTrial) -> None:
    """Quaternions of norms from 0.9905 to 1.0095, half-turns, and next to the identity."""
    expect_rotations(trial, taking(trial, 1.0, 100))


@check("ACC-3", observable=REGISTERED, on={SERVER: SHOWN})
def check_rotations_in_device_memory_do_not_shear(trial: ServerTrial) -> None:
    """‖RᵀR − I‖₂ of the matrix that the image was rendered with."""
    expect_no_shear(trial, taking(trial, 1.0, 100))


@check("ACC-4", observable=REGISTERED, on={SERVER: SHOWN})
def check_translations_in_device_memory_are_exact(trial: ServerTrial) -> None:
    """t = −Rᵀ·c of the view, for cameras up to 1,000 units from the origin."""
    expect_translations(trial, taking(trial, 1e3, 100))


@check("ACC-5", observable=REGISTERED, on={SERVER: SHOWN})
def check_the_camera_in_device_memory_is_where_it_was_put(trial: ServerTrial) -> None:
    """The camera's centre, as the image has it, up to 10,000 units from the origin."""
    expect_centres(trial, taking(trial, 1e4, 100))


@check("ACC-6", observable=REGISTERED, on={SERVER: SHOWN})
def check_single_precision_in_device_memory_is_rounded_once(trial: ServerTrial) -> None:
    """Cameras up to 100,000 units from the origin, where each digit that was lost is seen."""
    expect_centres(trial, taking(trial, 1e5, 100))
