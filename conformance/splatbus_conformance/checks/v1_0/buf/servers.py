"""Checks on what a server stores in its images, and when (spec 1.0 chapter 5, 1.1 chapter 5)."""

import random
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.checks import SERVER, SERVER_DEVICE, SERVER_HOST, Place, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.known_scene import COLOR_BUDGET, render
from splatbus_conformance.images.memory.reading import Pixels
from splatbus_conformance.images.reprojection import DEPTHS, ROWS
from splatbus_conformance.trials.moves.frame_capture import AT_REST, FrameCapture
from splatbus_conformance.trials.moves.gallery import Gallery, HostGallery, gallery
from splatbus_conformance.trials.moves.survey import WHOLE, anywhere, first_view, likeness
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import NotObservable

PIXELS = ("1.1", "frames", "pixels")
SHOWN = {SERVER_HOST: PIXELS, SERVER_DEVICE: ("cuda", "device")}
SUBSCRIBES = (*PIXELS, "capability:subscribe")
SMALLEST = float(np.finfo(np.float32).tiny)
MOST = 0.5
"""With fewer sensible numbers than this an image is read in the wrong order of bytes, if the other
order makes sense of them all."""
OPAQUE = 0.5
COVERED_ALPHA = 1.0 / 255.0
SENTINEL = 0.9
"""The share of transparent pixels that hold one value, from which it was meant to say "empty"."""
GLANCE_SECONDS = 0.06
"""Time enough for a write that was under way to end."""
STEPS = 3
STEP_SECONDS = 0.01
STRAGGLERS = 2
"""So many images may still come of what the camera did before it came to rest."""
ROUNDS, MOST_STEPS = 3, 200
"""How often the camera is moved while an image is held: so many times as the ring has slots; more
often for a server that is slow, but at most so often."""

Mask = NDArray[np.bool_]


# What is stored


@check("BUF-1", on=SHOWN, given=gallery)
def check_rows_are_bottom_up(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """Flipped or mirrored images fit no camera, and no scene that is known, as they lie."""
    images.judge(ROWS)


@check("BUF-2", on=SHOWN, given=gallery)
def check_numbers_are_little_endian(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """Colours that are from 0 to 1 only if their bytes are read from the other end."""
    for image in images.some():
        right, swapped = _sensible(image.color), _sensible(image.color.byteswap())
        trial.expect(
            not (swapped == 1.0 and right < MOST and image.color.any()),
            "big-endian",
            f"colours of image {image.frame['seq']} are from 0 to 1 if they are read as big-endian",
        )


@check("BUF-3", on=SHOWN, given=gallery)
def check_colours_are_from_0_to_1(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """Every number of every pixel, of images from several cameras."""
    for image in images.some():
        with np.errstate(invalid="ignore"):
            wrong = ~((image.color >= 0.0) & (image.color <= 1.0))
        what = "colours that are not from 0 to 1"
        _expect_none(trial, "out-of-range", what, wrong, image, image.color)


@check("BUF-5", on=SHOWN, given=gallery)
def check_alpha_is_1_where_there_is_none(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """Alpha that is the same everywhere, whatever is seen, was not rendered: then it is 1."""
    seen = list(images.some())
    if not any(image.covered().any() for image in seen):
        trial.not_observable("nothing is seen in its images")
    alphas = {float(alpha) for image in seen for alpha in np.unique(image.color[..., 3])[:2]}
    trial.expect(
        len(alphas) > 1 or alphas == {1.0},
        "wrong-alpha",
        f"alpha is {min(alphas)} in every pixel of {len(seen)} images, empty or not: a"
        " renderer that gives none has to store 1",
    )


@check("BUF-6", on=SHOWN, given=gallery)
def check_depth_is_planar(trial: ServerTrial, place: Place, images: Gallery) -> None:
    """What is no planar depth in scene units fits no image from elsewhere, and no scene that is
    known.
    """
    if place == "host":
        first = first_view(trial, 0.0)
        alpha = first.color[..., 3]
        opaque = alpha >= OPAQUE
        if opaque.any() and (alpha == 0.0).any():  # else it may be of a background alone
            deep = first.covered()[opaque].any()
            what = f"none of {opaque.sum()} pixels with an alpha from {OPAQUE} has a depth"
            trial.expect(deep, "no-depth", what)
    images.judge(DEPTHS, 1.0, 0.01, 100.0)


@check("BUF-7", on=SHOWN, given=gallery)
def check_empty_pixels_are_infinitely_far(trial: ServerTrial, _: Place, images: Gallery) -> None:
    """Every depth is one of a surface, or +∞, 100.0 or what the init packet announces. That pixels
    without alpha are empty is told only of images whose colour and depth are of one moment.
    """
    transparent = 0
    for image in images.some():
        with np.errstate(invalid="ignore"):
            senseless = ~(image.depth > 0) & ~np.isin(image.depth, image.empties())
        what = "depths that are neither positive nor what is empty"
        _expect_none(trial, "not-a-depth", what, senseless, image, image.depth)
        clear = _transparent(image)
        transparent += int(clear.sum())
        value = None if images.legacy else _sentinel(image, clear)
        trial.expect(
            not value,
            "wrong-empty-value",
            f"image {image.frame['seq']} stores {value} where nothing is seen, not +∞ or 100.0",
        )
    if not (transparent or images.legacy):
        trial.not_observable("no pixel of these images is transparent")


@check("ACC-9", on={SERVER: PIXELS})
def check_transparent_pixels_are_empty(trial: ServerTrial) -> None:
    """A pixel whose alpha is less than 1/255 holds no surface."""
    transparent = 0
    for image in HostGallery(trial).some():
        clear = _transparent(image)
        transparent += int(clear.sum())
        wrong = clear & image.covered() & (not _sentinel(image, clear))
        what = "pixels with a depth, and yet an alpha below 1/255"
        _expect_none(trial, "transparent-with-depth", what, wrong, image, image.depth)
    if not transparent:
        trial.not_observable("no pixel of these images is transparent")


def _expect_none(
    trial: ServerTrial, code: str, what: str, wrong: Mask, image: CapturedFrame, stored: Pixels
) -> None:
    """None of these pixels, or of their numbers, is what it must not be."""
    if wrong.any():
        row, column, *_ = np.argwhere(wrong)[0]
        trial.violated(
            code,
            f"{what}: {wrong.sum()} of {wrong.size} in image {image.frame['seq']},"
            f" {stored[wrong][0]} at row {row}, column {column}",
        )


def _sensible(color: Pixels) -> float:
    """The share of the numbers other than 0 that are colours, and not as good as 0."""
    numbers = color[color != 0]
    with np.errstate(invalid="ignore"):
        return float(((numbers >= SMALLEST) & (numbers <= 1.0)).mean()) if numbers.size else 1.0


def _transparent(image: CapturedFrame) -> Mask:
    """(h, w): alpha is below 1/255, in an image that is not transparent where something is."""
    clear: Mask = image.color[..., 3] < COVERED_ALPHA
    return clear if not clear.all() else np.zeros_like(clear)


def _sentinel(image: CapturedFrame, clear: Mask) -> float | None:
    """The one value that nearly all transparent pixels hold, if that is no permitted one."""
    wrong = clear & image.covered()
    if wrong.sum() < SENTINEL * max(clear.sum(), 1):
        return None
    values, counts = np.unique(image.depth[wrong], return_counts=True)
    return float(values[counts.argmax()]) if counts.max() > SENTINEL * wrong.sum() else None


# When it is stored


@check("IMG-4", on={SERVER: PIXELS})
def check_what_is_lent_is_not_written(trial: ServerTrial) -> None:
    """An image is held while the camera moves on and the ring goes round, more than once."""
    first, rng = first_view(trial, 0.0), random.Random(trial.seed)
    capture, told = FrameCapture(trial), False
    steps = ROUNDS * capture.slots
    for _ in trial.each(range(100 if trial.thorough else 2)):
        capture.go(anywhere(first, rng))
        held = capture.hold()
        trial.rest(GLANCE_SECONDS)
        held = capture.again(held)
        for _ in range(steps):
            capture.go(anywhere(first, rng))
            trial.rest(STEP_SECONDS)
        changed = _changed(held, capture.again(held))
        capture.give_back(held)
        trial.expect(
            not changed,
            "written-while-held",
            f"image {held.frame['seq']} was lent, and {changed} meanwhile",
        )
        following = capture.hold()
        capture.give_back(following)
        if following.frame["seq"] - held.frame["seq"] > capture.slots:
            told = True
        else:
            steps = min(2 * steps, MOST_STEPS)
    if not told:
        trial.not_observable("while an image is held, the server publishes too few others")


@check("IMG-6", on={SERVER: PIXELS})
def check_images_are_whole_when_they_are_lent(trial: ServerTrial) -> None:
    """An image is read the moment that its frame comes, and again while the camera rests."""
    first, rng = first_view(trial, 0.0), random.Random(trial.seed)
    capture = FrameCapture(trial)
    for _ in trial.each(range(500 if trial.thorough else 8)):
        capture.go(anywhere(first, rng))
        held = capture.hold()
        trial.rest(GLANCE_SECONDS)
        changed = _changed(held, capture.again(held))
        capture.give_back(held)
        trial.expect(
            not changed,
            "lent-unfinished",
            f"after the frame of image {held.frame['seq']} came, {changed}",
        )


@check("IMG-5", on={SERVER: PIXELS})
def check_colour_and_depth_are_of_one_moment(trial: ServerTrial) -> None:
    """The camera moves all the time; then it goes back to where each image says it was."""
    first, rng = first_view(trial), random.Random(trial.seed)
    capture, images = FrameCapture(trial), list[CapturedFrame]()
    capture.take(anywhere(first, rng))
    capture.go(anywhere(first, rng))
    for _ in range(200 if trial.thorough else 12):
        images.append(capture.hold())
        capture.go(anywhere(first, rng))
        trial.rest(STEP_SECONDS)
        for _ in range(STEPS):  # of which the image that is lent next is not of the last
            capture.go(anywhere(first, rng))
        capture.give_back(images[-1])
    for image in images:
        _expect_right(trial, capture, image, ("color", "depth"), "while the camera moved")


TURNS = (["color"], ["depth"], ["depth", "color"], ["depth"], ["color"], ["color", "depth"])
ONE_TOO_LATE = 4
"""In this turn depth is asked for once the image was given back, and nobody else wants colour."""


@check("IMG-20", on={SERVER: SUBSCRIBES})
def check_what_is_subscribed_to_is_written(trial: ServerTrial) -> None:
    """Colour and depth are asked for in turns, while an image is held and the camera moves; and the
    other one once it was given back, which comes too late for the next. There is an image by then
    for whoever wanted one before: a further reader sees it, if one is served.
    """
    first, rng = first_view(trial), random.Random(trial.seed)
    capture, found = FrameCapture(trial), list[tuple[CapturedFrame, Sequence[str]]]()
    began = trial.peer.clock()
    capture.take(anywhere(first, rng))
    rendering = GLANCE_SECONDS + 2 * (trial.peer.clock() - began)
    beside = _further_reader(trial)
    capture.go(anywhere(first, rng))
    held = capture.hold()
    for turn, asked in enumerate(TURNS * (20 if trial.thorough else 3)):
        if beside is not None:
            beside.take(anywhere(first, rng), None)  # what it says counts from the next on
            beside.take(anywhere(first, rng), None)
        else:
            capture.go(anywhere(first, rng))
            trial.rest(rendering)
        subscription = {"type": "subscribe", "channels": asked}
        trial.viewer.say(capture.reader, subscription)
        too_late = {"type": "subscribe", "channels": ["depth"]}
        capture.give_back(held, *[too_late] * (turn % len(TURNS) == ONE_TOO_LATE))
        held = capture.hold()
        if beside is not None:
            trial.viewer.say(beside.reader, subscription)
        found.append((held, asked))
    capture.give_back(held)
    for image, channels in found:
        why = f"after a subscription to {' and '.join(channels)}"
        _expect_right(trial, capture, image, channels, why)


def _further_reader(trial: ServerTrial) -> FrameCapture | None:
    try:
        return FrameCapture(trial)
    except NotObservable:
        return None


def _changed(before: CapturedFrame, after: CapturedFrame) -> str:
    """How two copies of a slot differ, NaN being like NaN; nothing if they do not."""
    color = (before.color.view(np.uint32) != after.color.view(np.uint32)).any(axis=-1)
    depth = before.depth.view(np.uint32) != after.depth.view(np.uint32)
    if not (color.any() or depth.any()):
        return ""
    return f"{color.mean():.0%} of its colour and {depth.mean():.0%} of its depth changed"


def _expect_right(
    trial: ServerTrial,
    capture: FrameCapture,
    image: CapturedFrame,
    channels: Sequence[str],
    when: str,
) -> None:
    """These channels are what the camera of the image sees: by the scene, where that is known, or
    by a further image of a camera that is put there.
    """
    shares = _right(trial, capture, image)
    for channel, right in zip(("color", "depth"), shares, strict=True):
        if channel not in channels or right >= WHOLE:
            continue
        _expect_still(trial, capture, image)
        trial.violated(
            "other-pixels",
            f"{1 - right:.0%} of the {channel} of image {image.frame['seq']}, rendered {when}, is"
            f" not of the camera that its frame names, {image.pose}",
        )


def _expect_still(trial: ServerTrial, capture: FrameCapture, image: CapturedFrame) -> None:
    """The positive control: the camera at rest, put there once more, sees what it should, and the
    same for as long as the check has lasted.
    """
    lasted = time.monotonic() - capture.began
    again = [capture.take(image.pose, AT_REST), *capture.stay(GLANCE_SECONDS)][-1]
    # Either suffices: a server may take the other from another image.
    still = max(_right(trial, capture, again)) >= WHOLE
    settled = capture.stay(lasted)[STRAGGLERS:]
    if not still or any(likeness(settled[0], it) < WHOLE for it in settled):
        trial.not_observable("the scene moves by itself, or is another than it was")


def _right(trial: ServerTrial, capture: FrameCapture, image: CapturedFrame) -> tuple[float, float]:
    """The share of the colours that are right, and that of the depths."""
    if trial.facts.scene_known:
        exact = render(image.camera, trial.facts.setting(image.frame))
        color = (exact.color_error(image.color) <= COLOR_BUDGET)[exact.certain]
        return float(color.mean()), float(exact.depth_is_right(image.planar()).mean())
    again = capture.take(image.pose, AT_REST)
    same = np.isclose(image.color, again.color, rtol=0, atol=2 * COLOR_BUDGET).all(axis=-1)
    near = np.isclose(image.planar(), again.planar(), rtol=1e-3, atol=0)
    return float(same.mean()), float(near.mean())
