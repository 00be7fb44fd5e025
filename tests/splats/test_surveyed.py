"""What the harness makes of images of splats, which agree at few points by any reading."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.pinhole import camera_of
from splatbus_conformance.images.reprojection import DEPTHS, MOMENTS, POSES, QUATERNIONS, ROWS
from splatbus_conformance.trials.moves.survey import SurveyShot, moves, weigh
from splatbus_server.view import field_of_view
from splatbus_splats.beginning import reaching
from splatbus_splats.made import garden, poses
from splatbus_splats.scene import Frames, Scene
from splatbus_wire.poses import Pose as WirePose

from tests.splats.shots import drawn, view_of

pytestmark = pytest.mark.usefixtures("loops")
SIZE = 160, 120
EVERY = (QUATERNIONS, POSES, ROWS, DEPTHS, MOMENTS)
Spoil = Callable[[Any, Any, Any], tuple[Any, Any]]
"""What a renderer may have done to colour and depth."""


def shot(scene: Scene, camera: Pose, lens: Any, spoil: Spoil) -> SurveyShot:
    """The image of a camera."""
    image = drawn(view_of(WirePose(*camera), size=SIZE, intrinsics=lens), scene.at(None))
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(image.inverse > 0, image.color[..., 3] / image.inverse, np.inf)
        color, depth = spoil(image.color, depth.astype(np.float32), lens)
    named = {"position": list(camera.position), "rotation": list(camera.rotation)}
    size = {"width": SIZE[0], "height": SIZE[1]}
    frame = {"camera": {**named, **lens._asdict(), **size}}
    told = camera_of(frame)
    assert told is not None
    return SurveyShot(camera, CapturedFrame(frame, told, color, depth, {}))


def rightly(color: Any, depth: Any, _: Any) -> tuple[Any, Any]:
    return color, depth


def z_buffer(color: Any, depth: Any, lens: Any) -> tuple[Any, Any]:
    scaled = lens.far / (lens.far - lens.near) * (1.0 - lens.near / depth.astype(np.float64))
    return color, scaled.astype(np.float32)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene({"default": Frames((garden(30_000),))})


@pytest.mark.parametrize(
    ("spoil", "broken", "words"),
    [
        (rightly, None, ""),
        (lambda c, d, _: (c[::-1], d[::-1]), ROWS, "rows stored top-down, or a pose in Unity's"),
        (lambda c, d, _: (c[:, ::-1], d[:, ::-1]), ROWS, "columns stored from right to left"),
        (lambda c, d, _: (c, d[::-1]), ROWS, "rows stored top-down, of depth alone. "),
        (z_buffer, DEPTHS, "values of a z-buffer, from 0 at near to 1 at far"),
        (lambda c, d, _: (c, d * 100), DEPTHS, "depths of which 100 make a scene unit"),
    ],
)
def test_what_is_wrong_with_images_of_a_garden_is_named_and_nothing_else(
    scene: Scene, spoil: Spoil, broken: Any, words: str
) -> None:
    first = Pose(*poses()[0])
    lens = reaching(field_of_view(*SIZE), first.position, scene.bounds)
    around = moves(shot(scene, first, lens, rightly).photograph)
    taken = [shot(scene, each, lens, spoil) for each in (*around, first)]
    trial: Any = SimpleNamespace(
        facts=SimpleNamespace(scene_known=False), measured=lambda *told: None
    )
    found = {wrong: weigh(trial, taken, wrong).broken for wrong in EVERY}
    assert [wrong for wrong in EVERY if found[wrong]] == ([broken] if broken else [])
    assert words in (found[broken] if broken else "")
