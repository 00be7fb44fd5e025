"""Images from around the first view of a server, and the judgement of what they fit."""

import math
import random
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import turned_about
from splatbus_conformance.images.reprojection import (
    APART,
    AS_SPECIFIED,
    EVERY,
    FITS,
    MIRRORED,
    ROWS,
    Z_BUFFERS,
    Misreading,
    ViewPair,
    explain,
    named,
    same_rows,
    tells,
)
from splatbus_conformance.trials.moves.frame_capture import FrameCapture
from splatbus_conformance.trials.server import ServerTrial

LEAST_COVERED = 0.1
STEP = 0.1
"""How far the camera moves, by the median depth that it sees."""
TURN = 1 / 6
"""How far it turns, by its field of view."""
ALIKE = 0.05
WHOLE = 0.99
"""The share of pixels that must be right in an image that is whole."""
MOVES = (
    ((1, 0, 0), (1, 0, 0), 0),
    ((0, 1, 0), (1, 0, 0), 0),
    ((0, 0, -1), (1, 0, 0), 0),
    ((0.02, 0, 0), (1, 0, 0), 1),
    ((0, 0.02, 0), (0, 1, 0), 1),
    ((0, 0, -0.02), (0, 0, 1), 2),
    ((1, -1, -1), (1, -2, 3), 1),
    ((-1, 1, 0.5), (-2, 1, -1), 1),
)
"""In the first camera's axes: steps along x, y, z; an axis, and turns about it."""


class SurveyShot(NamedTuple):
    """A pose that was sent, and the image that came of it."""

    sent: Pose
    photograph: CapturedFrame


def moves(first: CapturedFrame, scale: float = 1.0) -> list[Pose]:
    """Poses around a first view from which most of it is still seen; `scale` makes more of them."""
    depths = first.planar()[first.covered()]
    step = scale * STEP * (float(np.median(depths)) if depths.size else 1.0)
    camera = first.camera
    narrow = min(camera.width / camera.fx, camera.height / camera.fy)
    turn = TURN * 2.0 * math.atan(narrow / 2.0)
    return [
        Pose(
            tuple(map(float, camera.pose.place(step * np.array(steps, np.float64)))),
            turned_about(first.pose.rotation, axis, turns * turn),
        )
        for steps, axis, turns in MOVES
    ]


def anywhere(first: CapturedFrame, rng: random.Random) -> Pose:
    """Some pose around a first view."""
    near = rng.choice(moves(first))
    nudge = [STEP * 0.1 * rng.uniform(-1, 1) for _ in range(3)]
    place = tuple(number + part for number, part in zip(near.position, nudge, strict=True))
    return Pose(place, turned_about(near.rotation, nudge, 0.05))


def first_view(trial: ServerTrial, least: float = LEAST_COVERED) -> CapturedFrame:
    """The image that the server showed at first; skips the check if it shows less than this."""
    first = trial.facts.first
    if first is None:
        trial.not_observable("the server showed no image")
    if first.covered().mean() < least:
        trial.not_observable("the server's first image has hardly a pixel with alpha and depth")
    return first


def survey(trial: ServerTrial, scale: float = 1.0) -> list[SurveyShot]:
    """Images from around the first view, and last from where it was itself.

    It ends early with an image whose frame names another camera than was sent.
    """
    first = first_view(trial)
    capture, found = FrameCapture(trial), []
    for pose in (*moves(first, scale), Pose(*first.pose)):
        found.append(SurveyShot(pose, capture.take(pose)))
        if named(found[-1].photograph.camera.pose, pose) is not AS_SPECIFIED:
            break
    return found


class SurveyFinding(NamedTuple):
    """What images tell of a requirement: that it is broken, why they tell nothing, or neither."""

    broken: str = ""
    silent: str = ""
    code: str = ""
    """Of what it is broken by."""


def judge_readings(trial: ServerTrial, wrong: Sequence[Misreading], *scales: float) -> None:
    """The requirement is violated if images fit one of these wrong readings.

    Surveys with steps of other scales are made as well, where those before tell nothing. Skips the
    check if none does: if the images fit another reading or none, or cannot tell.
    """
    silent = []
    for scale in scales or (1.0,):
        taken = survey(trial, scale)
        finding = weigh(trial, taken, wrong)
        if finding.broken:
            _expect_still(trial, taken)
            trial.violated(finding.code, finding.broken)
        if not finding.silent:
            return
        silent.append(finding.silent)
    trial.not_observable(silent[0])


def weigh(
    trial: ServerTrial, taken: Sequence[SurveyShot], wrong: Sequence[Misreading]
) -> SurveyFinding:
    """What these images tell of a requirement that is broken where they fit one of the readings."""
    if len(taken) <= len(MOVES):
        return SurveyFinding(silent="the server did not show the camera where it was put")
    *others, base = (it.photograph.view() for it in taken)
    shares = explain([ViewPair(base, other) for other in others], EVERY)
    right, by_words = float(shares[0]), dict(zip(EVERY, map(float, shares), strict=True))
    if right >= FITS:
        alike = [it.words for it in wrong if by_words[it] > right - APART]
        said = f"the images fit {_either(alike)} as well as what the frames say: {right:.0%}"
        trial.measured(
            "points of one image off in others", 100 * (1 - right), None, "%", _at(taken)
        )
        return SurveyFinding(silent=said if alike else "")
    best = float(shares[1:].max())
    if right >= best and tells(right, max(by_words[it] for it in wrong)):
        return SurveyFinding()
    # Values that are all but alike fit wherever the camera was.
    found = [it for it in Z_BUFFERS if tells(by_words[it], right)]
    best = max(by_words[it] for it in found) if found else best
    found = found or [it for it in EVERY[1:] if by_words[it] > best - ALIKE]
    if trial.facts.scene_known:
        found = [it for it in found if it not in ROWS]
    if not found or not tells(best, right):
        return SurveyFinding(
            silent="the images do not show from where they are seen; those of soft or sparse splats"
            f" never do: as the frames say, {right:.0%} of the points match between two images, and"
            f" with the likeliest mistake {best:.0%}"
        )
    guilty = MIRRORED if MIRRORED in found else found[0]
    depth_alone = guilty in ROWS and _depth_alone(taken, guilty)
    others_ = [] if depth_alone else [it.words for it in found if it != guilty]
    words = [guilty.words + ", of depth alone" * depth_alone, *others_]
    if guilty not in wrong or not (guilty == MIRRORED or set(found) <= set(wrong)):
        return SurveyFinding(
            silent=f"the images fit {_either(words)}, which other requirements forbid"
        )
    return SurveyFinding(
        f"the images fit {_either(words)}. If so, {best:.0%} of the points match between two"
        f" images; as the frames say, {right:.0%} do",
        code=guilty.code,
    )


def _depth_alone(taken: Sequence[SurveyShot], reading: Misreading) -> bool:
    """Whether colours lie as they should where depths lie as this reading has it."""
    *others, base = (it.photograph for it in taken)
    pair = ViewPair(base.view(), others[0].view())
    before, after = (it.color[..., :3].mean(axis=-1, dtype=np.float64) for it in (base, others[0]))
    return not same_rows(before, after, pair, reading)


def _expect_still(trial: ServerTrial, taken: Sequence[SurveyShot]) -> None:
    """The positive control: the same camera shows the same, so the scene stands still."""
    sent, former = taken[-1]
    capture = FrameCapture(trial)
    capture.take(taken[0].sent)
    if not alike(former, capture.take(sent)):
        trial.not_observable("the scene moves by itself")


def alike(some: CapturedFrame, others: CapturedFrame, share: float = WHOLE) -> bool:
    """Whether nearly all pixels of two images are the same, but for rounding."""
    return likeness(some, others) >= share


def likeness(some: CapturedFrame, others: CapturedFrame) -> float:
    """The share of pixels that are the same, but for rounding."""
    if some.depth.shape != others.depth.shape:
        return 0.0
    same_color = np.isclose(some.color, others.color, rtol=0, atol=2 / 255).all(axis=-1)
    same_depth = np.isclose(some.planar(), others.planar(), rtol=1e-3, atol=0)
    return float((same_color & same_depth).mean())


def _either(words: Sequence[str]) -> str:
    return ", or ".join(words) + " (they cannot show which)" * (len(words) > 1)


def _at(taken: Sequence[SurveyShot]) -> str:
    return f"{len(taken)} images around {taken[-1].sent}"
