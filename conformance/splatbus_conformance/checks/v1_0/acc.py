"""Checks on how exactly a server that shows the scene of SCENE.md renders what it was told.

Spec 1.0 chapter 8. Its budgets are for double precision, and images are in single precision: what
an image can show is a breach that single precision does not explain, and that is what is judged.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from splatbus_conformance.cases.valid.numbers import hard_numbers, nearest, spelled_as
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, SERVER_DEVICE, SERVER_HOST, Cases, Place, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import HardView, hardest, staged, stages
from splatbus_conformance.images.known_scene import (
    COLOR_BUDGET,
    DEPTH_BUDGET,
    NOTHING,
    ExactImage,
    render,
)
from splatbus_conformance.images.pinhole import ObjectPlacement, Reals, Rigid, rigid
from splatbus_conformance.images.registration import Registration, register
from splatbus_conformance.images.reprojection import AS_SPECIFIED, named
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.moves.frame_capture import AT_REST, FrameCapture, aside
from splatbus_conformance.trials.moves.gallery import Gallery, HostGallery, gallery
from splatbus_conformance.trials.moves.survey import WHOLE
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import camera_pose

SCENE = ("1.1", "frames", "pixels", "scene")
SHOWN = {SERVER_HOST: SCENE, SERVER_DEVICE: ("cuda", "device")}
VISIBLE = 1e-5
"""What is off by more than this is seen in an image of single precision."""
SINGLE = 2.0**-23
"""One unit in the last place of single precision, relative."""
RENDERER = 4.0
"""Such units that a renderer may lose by its own arithmetic in single precision."""
SMALL = 12_000
"""Pixels of an image up to which there are as many cases as wanted, and fewer of larger ones."""
ASTRAY = 0.05
"""An image whose depths are mostly off by more, relative, is of another camera."""
ORDERED = 1e-3
"""How much farther, relative, a surface has to be to count as farther: less is lost by whoever
renders in single precision, and then d itself is out of order."""
NEIGHBOURS = [(repr(near), repr(near), "0.1") for near in (0.3, math.nextafter(0.3, 1.0), 0.3)]
"""A frame of the one is none of the other, though no tolerance tells them apart."""
LOOKS_DOWN = (-math.sin(0.25), 0.0, 0.0, math.cos(0.25))


class ShownView(NamedTuple):
    """What was asked for, what came, and what had to."""

    stage: HardView
    photograph: CapturedFrame
    exact: ExactImage
    scene: Rigid


def shown(
    trial: ServerTrial, images: Gallery, farthest: float, quick: int, full: int = 500
) -> Iterator[ShownView]:
    """Cameras and scenes up to so far from the origin, and the image that came of each."""
    kind = None
    if images.legacy:
        kind, quick, full = _norm, 2, 100
    salt, (width, height) = trial.requirement.id, trial.facts.size
    quick = max(2, min(quick, quick * SMALL // (width * height)))  # the first one is simple
    listed, drawn = hardest(salt, farthest), stages(salt, farthest)
    for camera, scene_ in trial.each(
        listed, drawn, kind=kind, spare=0, quick=quick, full=full, search=salt
    ):
        stage = HardView(Pose(*map(tuple, camera)), Pose(*map(tuple, scene_)))
        photograph, scene = images.take(*stage), rigid(*stage.scene)
        if not np.allclose(photograph.camera.pose.position, stage.camera.position, rtol=1e-5):
            what = f"a camera was put to {stage.camera}, and a frame names {photograph.pose}"
            near = named(photograph.camera.pose, stage.camera) is AS_SPECIFIED
            trial.expect(not near, "lost-digits", f"{what}: it has lost digits")
            trial.not_observable(what)
        setting = trial.facts.setting(photograph.frame, ObjectPlacement(scene))
        yield ShownView(stage, photograph, render(photograph.camera, setting), scene)


@check("IMG-5", on={SERVER: SCENE})
def check_every_pixel_is_of_the_camera(trial: ServerTrial) -> None:
    """Cameras and scenes turned in every way: colour and depth of each pixel have to be right."""
    for stage, photograph, exact, _ in shown(trial, HostGallery(trial), 10.0, 8):
        depth, right = photograph.planar(), exact.depth_is_right(photograph.planar())
        color = exact.color_error(photograph.color)
        both = exact.certain & np.isfinite(depth) & np.isfinite(exact.depth)
        with np.errstate(invalid="ignore"):
            ulps = np.abs(depth - exact.depth) / np.spacing(exact.depth.astype(np.float32))
        trial.measured("colour", 255 * float(color.max()), None, "/255", str(stage.camera))
        trial.measured(
            "depth", float(ulps[both].max(initial=0.0)), None, "ULP", _where(stage, ulps, both)
        )
        for what, code, share in (
            ("colour", "other-colours", float((color <= COLOR_BUDGET)[exact.certain].mean())),
            ("depth", "other-depths", float(right[exact.certain].mean())),
        ):
            trial.expect(
                share >= WHOLE,
                code,
                f"the {what} of {1 - share:.1%} of the pixels is not what the camera at"
                f" {stage.camera} sees of the scene at {stage.scene}",
            )


@check("ACC-13", on={SERVER: SCENE})
def check_every_pixel_is_what_single_precision_can_do(trial: ServerTrial) -> None:
    """Cameras and scenes up to a million units from the origin: colour and depth of every pixel but
    those next to an edge, a tie or a clipping plane.
    """
    for stage, photograph, exact, _ in shown(trial, HostGallery(trial), 1e6, 4):
        errors = (
            ("colour", exact.color_error(photograph.color), COLOR_BUDGET, ""),
            ("depth", exact.depth_error(photograph.planar()), DEPTH_BUDGET, "of itself"),
        )
        for what, error, budget, unit in errors:
            worst = float(error.max(initial=0.0))
            trial.measured(what, worst, budget, unit, _where(stage, error, exact.certain))
    trial.expect_within_budgets()


@check("ACC-12", on={SERVER: SCENE})
def check_what_is_farther_has_no_smaller_depth(trial: ServerTrial) -> None:
    """The scene from 1 to 50 units away, all of it opaque: no pixel may hold a smaller depth than
    one whose surface is nearer.
    """
    capture, compared = FrameCapture(trial), 0
    capture.take(aside(AT_REST))  # shows that no other connection has control any more
    for away in trial.each((1.0, 5.0, 15.0, 30.0, 50.0)):
        stage = staged(AT_REST, Pose((0.0, -0.5 * away, -0.8 * away), LOOKS_DOWN))
        photograph = capture.take(*stage)
        setting = trial.facts.setting(photograph.frame, ObjectPlacement(rigid(*stage.scene)))
        exact = render(photograph.camera, setting)
        depth = photograph.planar()
        both = exact.certain & np.isfinite(exact.depth) & np.isfinite(depth)
        order = np.argsort(exact.farthest[both])
        right, stored = exact.farthest[both][order], depth[both][order]
        nearer = np.searchsorted(right, exact.nearest[both][order] * (1.0 - ORDERED))
        greatest = np.maximum.accumulate(np.concatenate(([0.0], stored)))[nearer]
        compared += int((nearer > 0).sum())
        if (wrong := stored < greatest).any():
            at = int(np.argmax(greatest - stored))
            trial.violated(
                "depths-out-of-order",
                f"the depth of {wrong.sum()} surfaces is less than that of a nearer one: at depth"
                f" {right[at]:.6g} it is {stored[at]:.6g}, and {greatest[at]:.6g} nearer by",
            )
    if not compared:
        trial.not_observable("no image showed surfaces at two depths")


@check("BUF-2", on={SERVER: SCENE})
def check_colour_is_red_green_blue_alpha(trial: ServerTrial) -> None:
    """The four numbers of a pixel, against those of the scene in every order."""
    for stage, photograph, exact, _ in shown(trial, HostGallery(trial), 10.0, 1, 20):
        seen = exact.certain & (exact.what != NOTHING)
        given, wanted = photograph.color[seen], exact.color[seen]
        for order, words in (
            ((2, 1, 0, 3), "blue, green, red, alpha"),
            ((1, 2, 3, 0), "alpha, red, green, blue"),
            ((3, 2, 1, 0), "alpha, blue, green, red"),
        ):
            fits = np.isclose(given[:, order], wanted, rtol=0, atol=COLOR_BUDGET).all(axis=-1)
            trial.expect(
                not len(fits) or fits.mean() < 0.5,
                "another-order",
                f"its colours are stored as {words}: seen by the camera at {stage.camera}",
            )


def registered(
    trial: ServerTrial, images: Gallery, farthest: float, quick: int
) -> Iterator[tuple[ShownView, Registration, float]]:
    """The camera of each image as the image has it, and how far from it single precision can be."""
    found = 0
    for it in shown(trial, images, farthest, quick):
        camera = it.photograph.camera
        of_image = register(camera, it.photograph.planar(), it.exact, it.scene)
        if of_image is None:
            seen = float((it.photograph.covered() & it.exact.certain).sum())
            due = float(((it.exact.what != NOTHING) & it.exact.certain).sum())
            trial.expect(
                seen >= due / 2.0,
                "missing-pixels",
                f"{due:g} pixels have to show the scene from the camera at {it.stage.camera},"
                f" and {seen:g} show anything",
            )
            both = it.exact.certain & it.photograph.covered() & (it.exact.what != NOTHING)
            off = np.abs(it.photograph.planar()[both] / it.exact.depth[both] - 1.0)
            trial.expect(
                not both.any() or np.median(off) <= ASTRAY,
                "other-depths",
                f"the depths of half of the pixels are off by {np.median(off):.0%} and more from"
                f" the camera at {it.stage.camera}",
            )
            continue
        found += 1
        yield it, of_image, VISIBLE + 5.0 * of_image.uncertainty
    if not found:
        trial.not_observable("no image showed enough of the scene")


@check("ACC-2", on=SHOWN, given=gallery)
def check_rotations_are_those_of_the_quaternion(
    trial: ServerTrial, _: Place, images: Gallery
) -> None:
    """Quaternions of norms from 0.9905 to 1.0095, half-turns, and next to the identity."""
    for it, image, visible in registered(trial, images, 1.0, 5):
        error = float(np.abs(image.rotation - it.photograph.camera.pose.rotation).max())
        trial.measured("entry of the rotation matrix", error, visible, "", str(it.stage.camera))
    trial.expect_within_budgets()


@check("ACC-3", on=SHOWN, given=gallery)
def check_rotations_do_not_shear(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """‖RᵀR − I‖₂ of the matrix that the image was rendered with."""
    for it, image, visible in registered(trial, images, 1.0, 5):
        trial.measured("‖RᵀR − I‖₂", image.shear, 2 * visible, "", str(it.stage.camera))
    trial.expect_within_budgets()


@check("ACC-4", on=SHOWN, given=gallery)
def check_translations_are_exact(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """t = −Rᵀ·c of the view, for cameras up to 1,000 units from the origin."""
    for it, image, visible in registered(trial, images, 1e3, 3):
        pose = it.photograph.camera.pose
        wanted = -pose.rotation.T @ pose.position
        # A rotation that is off would show here, too, by as much as the camera is far: ACC-2.
        moved = wanted - pose.rotation.T @ (image.position - pose.position)
        _measure(trial, "translation", moved, wanted, visible, str(it.stage.camera))
    trial.expect_within_budgets()


@check("ACC-5", on=SHOWN, given=gallery)
def check_the_camera_is_where_it_was_put(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """The camera's centre, as the image has it, up to 10,000 units from the origin."""
    _expect_centres(trial, images, 1e4)


@check("ACC-6", on=SHOWN, given=gallery)
def check_single_precision_is_rounded_once(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """Cameras up to 100,000 units from the origin, where each digit that was lost is seen."""
    _expect_centres(trial, images, 1e5)


def _expect_centres(trial: ServerTrial, images: Gallery, farthest: float) -> None:
    for it, image, visible in registered(trial, images, farthest, 3):
        wanted = it.photograph.camera.pose.position
        _measure(trial, "camera centre", image.position, wanted, visible, str(it.stage.camera))
    trial.expect_within_budgets()


def _measure(
    trial: ServerTrial, what: str, image: Reals, wanted: Reals, visible: float, input: str
) -> None:
    """An error, norm-wise, in units in the last place of single precision."""
    unit = SINGLE * max(1.0, float(np.linalg.norm(wanted)))
    error, budget = float(np.linalg.norm(image - wanted)) / unit, RENDERER + visible / unit
    trial.measured(what, error, budget, "ULP of single precision", input)


@check(
    "ACC-14",
    on={SERVER: ("frames",)},
    given=CameraControl,
    cases=Cases(NEIGHBOURS, st.tuples(*(hard_numbers() for _ in "xyz")), quick=30, full=1000),
)
def check_numbers_are_read_to_the_last_bit(
    trial: ServerTrial, steering: CameraControl, texts: tuple[str, str, str]
) -> None:
    """Positions in decimals next to halfway between two doubles, exact ones, and of 17 digits; some
    of them one unit in the last place apart. A server may hold them in single precision, rounded
    once more.
    """
    position = tuple(map(nearest, texts))
    pose = camera_pose(position)
    spelled = spelled_as(pose, dict(zip("xyz", texts, strict=True)))
    if steering.takes(in_use(trial), pose, spelled) != "accepts":
        missed = f"no frame shows a camera at {', '.join(texts)}; it is at {steering.now()}"
        trial.expect(trial.number, "not-applied", missed)
        trial.not_observable(missed)
    for text, right, told in zip(texts, position, steering.now().position, strict=True):
        trial.expect(
            told in (right, float(np.float32(right))),
            "misrounded",
            f"{text} was taken for {told!r}, and {right!r} is nearest to it",
        )


def _norm(stage: HardView) -> float:
    """A kind of stage: what the norm of its rotation is near to."""
    return round(math.hypot(*stage.camera.rotation), 3)


def _where(stage: HardView, error: Reals, considered: NDArray[np.bool_]) -> str:
    at = np.unravel_index(int(np.argmax(np.where(considered, error, -1.0))), error.shape)
    return f"row {at[0]}, column {at[1]} from {stage.camera}"
