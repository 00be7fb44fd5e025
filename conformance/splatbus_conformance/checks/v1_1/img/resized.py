"""Checks on images that have changed their size (spec 1.1 chapter 8)."""

from collections.abc import Iterator
from contextlib import contextmanager

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.moves.image_session import elsewhere
from splatbus_conformance.trials.moves.lenses import in_force, lens_of, scaled
from splatbus_conformance.trials.moves.resizing import (
    RESIZES,
    Sitting,
    Size,
    changed,
    other_sizes,
    sitting,
)
from splatbus_conformance.trials.moves.survey import WHOLE, first_view, likeness
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.messages import Json


@check(
    "IMG-5",
    on={SERVER: (*RESIZES, "pixels")},
    given=sitting,
    cases=lambda trial, _: Cases(other_sizes(trial)[:3]),
)
def check_images_of_another_size_are_right(trial: ServerTrial, given: Sitting, size: Size) -> None:
    """The size changes, while a reader looks on: each image is of the camera that it names."""
    client, capture = given
    changed(trial, client, size, capture.reader)
    seen = capture.take(elsewhere(trial), None)
    if seen.color.shape[:2] != size[::-1]:
        fell_silent(trial, capture.reader, "the server sent no image of the new size")
    if trial.facts.scene_known:
        exact = render(seen.camera, trial.facts.setting(seen.frame))
        right = exact.agreement(seen.color, seen.planar())
    else:
        capture.take(elsewhere(trial), None)
        again = capture.take(seen.pose, None)
        right = likeness(seen, again)
        if right < WHOLE and any(
            likeness(again, it) < WHOLE for it in capture.stay(REACTION_SECONDS)
        ):
            trial.not_observable("the scene moves by itself")
    told = f"{1 - right:.0%} of the pixels of an image of {size[0]}×{size[1]}"
    trial.expect(right >= WHOLE, "other-pixels", f"{told} are not what its camera sees")


@contextmanager
def through_a_lens(trial: ServerTrial) -> Iterator[tuple[Sitting, Json]]:
    """Who changes the size and who reads, and the intrinsics that images have."""
    lens = lens_of(first_view(trial, 0.0), *trial.facts.size, 1.25, 0.75, 0.1, -0.1)
    with sitting(trial) as it:
        it.capture.take(elsewhere(trial), None, intrinsics=lens)
        yield it, lens


@check(
    "CAM-5",
    on={SERVER: (*RESIZES, "pixels", "capability:intrinsics")},
    given=through_a_lens,
    cases=lambda trial, _: Cases([*other_sizes(trial)[:3], trial.facts.size]),
)
def check_lenses_are_scaled_to_another_size(
    trial: ServerTrial, given: tuple[Sitting, Json], size: Size
) -> None:
    """Intrinsics are sent for images of one size, and then that changes, also to other shapes."""
    (client, capture), lens = given
    changed(trial, client, size, capture.reader)
    wrong = in_force(capture.take(elsewhere(trial), None).frame, scaled(lens, size))
    told = f"after intrinsics for {trial.facts.size} images became {size}"
    trial.expect(not wrong, "other-intrinsics", f"{told}: {wrong}")
