"""Checks on what a server's images show: of which camera they are, and of which scene.

Spec 1.0 chapters 5 to 7. Two images of a scene that stands still tell by which convention they
were rendered; of a scene that is known, each pixel tells.
"""

import random

import numpy as np

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import staged, turned_about
from splatbus_conformance.images.pinhole import rigid
from splatbus_conformance.images.reprojection import (
    APART,
    AS_SPECIFIED,
    CLOSE,
    DEPTHS,
    FITS,
    MOMENTS,
    POSES,
    QUATERNIONS,
    ROWS,
    SCENES,
    Misreading,
    ViewPair,
    agreement,
    explain,
    named,
)
from splatbus_conformance.trials.moves.frame_capture import AT_REST, FrameCapture
from splatbus_conformance.trials.moves.survey import (
    alike,
    first_view,
    judge_readings,
    likeness,
    moves,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import numbers
from splatbus_conformance.wire.messages import Json, camera_pose

PIXELS = ("1.1", "frames", "pixels")
CAMERAS_ASKED = 8
OPAQUE = 0.5


@check("BUF-1", observable="which way up the images fit one another", on={SERVER: PIXELS})
def check_rows_are_bottom_up(trial: ServerTrial) -> None:
    """Images from around the first view: flipped or mirrored ones fit no camera as they lie."""
    judge_readings(trial, ROWS)


@check("BUF-6", observable="by which depth the images fit one another", on={SERVER: PIXELS})
def check_depth_is_planar(trial: ServerTrial) -> None:
    """Images from around the first view: what is no planar depth in scene units fits no other."""
    first = first_view(trial, 0.0)
    alpha = first.color[..., 3]
    opaque = alpha >= OPAQUE
    if opaque.any() and (alpha == 0.0).any():  # else it may be of a background alone
        deep = first.covered()[opaque].any()
        trial.expect(
            deep,
            "no-depth",
            f"none of {opaque.sum()} pixels with an alpha from {OPAQUE} has a depth",
        )
    judge_readings(trial, DEPTHS, 1.0, 0.01, 100.0)


@check(
    "CNV-1", observable="the poses that frames name, and those that images fit", on={SERVER: PIXELS}
)
def check_poses_are_camera_to_world(trial: ServerTrial) -> None:
    """The camera of a frame, and of its image, is where and turned as the pose said."""
    _judge_names(trial, POSES)
    judge_readings(trial, POSES)
    _judge_reply(trial, POSES)


@check(
    "CNV-3",
    observable="the rotations that frames and replies name, and images fit",
    on={SERVER: PIXELS},
)
def check_rotations_are_hamilton_with_w_last(trial: ServerTrial) -> None:
    """The rotation of a frame, of its image and of a reply has its scalar last, and its sign."""
    _judge_names(trial, QUATERNIONS)
    judge_readings(trial, QUATERNIONS)
    _judge_reply(trial, QUATERNIONS)


@check(
    "IMG-5",
    observable="whether images follow the cameras that their frames name",
    on={SERVER: PIXELS},
)
def check_images_are_of_the_camera_that_is_named(trial: ServerTrial) -> None:
    """Images from around the first view fit the named cameras, not those before."""
    judge_readings(trial, MOMENTS)


@check(
    "POS-7", observable="the camera that frames name after many poses at once", on={SERVER: PIXELS}
)
def check_the_newest_camera_is_shown(trial: ServerTrial) -> None:
    """Several poses at once, of which the last has to be shown; far ones, too."""
    first, rng = first_view(trial, 0.0), random.Random(trial.seed)
    capture = FrameCapture(trial)
    capture.take(_near(rng, first.pose))
    for _ in trial.each(range(500 if trial.thorough else 25)):
        for _ in range(rng.randrange(6)):
            trial.move(camera_pose(*_near(rng, first.pose)))
        wanted = _near(rng, first.pose)
        shown = capture.take(wanted, insists=False)
        if named(shown.camera.pose, wanted) is None:
            trial.violated(
                "another-pose",
                f"after a camera at {wanted} the newest frame names one at {shown.pose}, 5 s later",
            )


@check("POS-7", observable="how the images follow the pose of the Gaussians", on={SERVER: PIXELS})
def check_the_newest_scene_is_shown(trial: ServerTrial) -> None:
    """The Gaussians are moved and turned, so that what is seen is what a camera would see that had
    moved instead; one does.
    """
    first = first_view(trial)
    capture, around = FrameCapture(trial), moves(first)
    before, instead = capture.take(around[0]), capture.take(around[-1])
    stage = staged(Pose(*first.pose), around[-1])
    after = capture.take(*stage)
    capture.take(around[0])
    same = _same_depths(instead, after)
    if same >= FITS and same - _same_depths(instead, first) >= APART:
        return
    moved, still = (
        ViewPair(before.view(), view, pose)
        for view, pose in ((after.view(), rigid(*stage.scene)), (instead.view(), rigid(*AT_REST)))
    )
    shares = explain([moved], (AS_SPECIFIED, *SCENES))
    right, best = float(shares[0]), float(shares[1:].max())
    control = agreement(still, AS_SPECIFIED)
    if min(best, control) < FITS or best - right < APART:
        trial.not_observable(
            f"the images cannot tell: {right:.0%} of the points are where the pose of the"
            f" Gaussians puts them, and {best:.0%} elsewhere; where a camera had moved instead it"
            f" were {control:.0%}"
        )
    if not alike(capture.take(Pose(*first.pose)), first):
        trial.not_observable("the scene moves by itself, or had been moved before")
    likeliest = SCENES[int(shares[1:].argmax())]
    trial.violated(
        likeliest.code,
        f"the images fit {likeliest.words}: {best:.0%} of the points, and {right:.0%} if it was",
    )


@check("POS-13", observable="whether an identity pose changes the first image", on={SERVER: PIXELS})
def check_the_scene_is_at_rest_at_first(trial: ServerTrial) -> None:
    """From where the first image was seen, with the identity as the pose of the Gaussians."""
    if not trial.testee.expendable:
        trial.not_observable("a server that others have used may have been told otherwise")
    first = first_view(trial)
    capture, elsewhere = FrameCapture(trial), moves(first)[0]
    capture.take(elsewhere)
    told = capture.take(Pose(*first.pose))
    if told.depth.shape != first.depth.shape:
        trial.not_observable("the server has changed the size of its images")
    if told.frame.get("time") != first.frame.get("time"):
        trial.not_observable("the server shows another time than at first")
    if alike(told, first):
        return
    capture.take(elsewhere)
    if not alike(capture.take(Pose(*first.pose)), told):
        trial.not_observable("the scene moves by itself")
    trial.violated(
        "not-at-rest",
        f"{1 - likeness(told, first):.0%} of the pixels changed when the Gaussians were given the"
        " identity pose, which they had to have before",
    )


def _same_depths(some: CapturedFrame, others: CapturedFrame) -> float:
    """The share of pixels that hold the same depth in two images, of those that hold any."""
    if some.depth.shape != others.depth.shape:
        return 0.0
    seen = some.covered() | others.covered()
    same = np.isclose(some.planar(), others.planar(), rtol=CLOSE, atol=0)
    return float(same[seen].mean()) if seen.any() else 0.0


def _judge_names(trial: ServerTrial, wrong: tuple[Misreading, ...]) -> None:
    """A frame that names a pose by one of these wrong readings is a violation."""
    first = first_view(trial)
    wanted = moves(first)[-1]
    shown = FrameCapture(trial).take(wanted)
    meant = named(shown.camera.pose, wanted)
    if meant in wrong:
        trial.violated(
            "misnamed-pose",
            f"a camera was sent to {wanted}; its frame names {shown.pose}: {meant.words}",
        )
    if meant is not AS_SPECIFIED:
        trial.not_observable(f"a camera was sent to {wanted}, and a frame names {shown.pose}")


def _judge_reply(trial: ServerTrial, wrong: tuple[Misreading, ...]) -> None:
    """The first view is of a camera that the scene comes with, or has nothing to do with any."""
    first, connection = first_view(trial), trial.dial("msg")
    for index in range(CAMERAS_ASKED):
        reply = trial.ask(connection, {"type": "get_camera_pose", "cam_idx": index}) or {}
        pose = _pose_of(reply)
        meant = pose and named(first.camera.pose, pose)
        if pose is None or meant is AS_SPECIFIED:
            return
        if meant in wrong:
            trial.violated(
                "misreported-pose",
                f"camera {index} is told as {pose}; the first frame was rendered at {first.pose}:"
                f" {meant.words}",
            )


def _pose_of(reply: Json) -> Pose | None:
    position, rotation = reply.get("position"), reply.get("rotation")
    if not (isinstance(position, list) and isinstance(rotation, list)):
        return None
    if not (numbers(position, 3) and numbers(rotation, 4) and any(rotation)):
        return None
    return Pose(tuple(map(float, position)), tuple(map(float, rotation)))


def _near(rng: random.Random, pose: Pose) -> Pose:
    """A pose about another one; now and then far from it."""
    spread = rng.choice((0.1, 1.0, 1e3))
    return Pose(
        tuple(number + rng.uniform(-spread, spread) for number in pose.position),
        turned_about(pose.rotation, [rng.gauss(0, 1) for _ in range(3)], rng.uniform(-3, 3)),
    )
