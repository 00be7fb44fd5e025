"""What a copied image tells: which pixels are covered, how deep they are, which scene it shows."""

import math
from typing import Any

import numpy as np
import pytest
from splatbus_conformance.images.captured import CapturedFrame, shows_the_scene
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.pinhole import camera_of, rigid
from splatbus_conformance.wire.messages import frame

DEPTHS = np.array([[np.inf, 100.0, 7.0, 2.5], [np.nan, -1.0, 0.0, 99.9]], np.float32)


def photograph(depth: Any = DEPTHS, *, kind: str = "planar_z", empty: Any = "inf") -> CapturedFrame:
    height, width = depth.shape
    message = frame(1, 1, 0, width, height)
    message["camera"] |= {"fx": 2.0, "fy": 2.0, "position": [0.0, 0.0, 0.0]}
    camera = camera_of(message)
    assert camera is not None
    color = np.zeros((*depth.shape, 4), np.float32)
    return CapturedFrame(message, camera, color, depth, {"depth": {"kind": kind, "empty": empty}})


def test_what_is_infinite_legacy_or_no_depth_is_not_covered() -> None:
    covered = [[False, False, True, True], [False, False, False, True]]
    assert photograph().covered().tolist() == covered
    assert np.isinf(photograph().planar()[~np.array(covered)]).all()


def test_the_announced_empty_depth_is_not_covered_either() -> None:
    assert photograph(empty=7).covered().tolist()[0] == [False, False, False, True]


def test_a_distance_along_the_ray_is_made_planar() -> None:
    depth = np.full((1, 1), 3.0, np.float32)
    seen = photograph(depth, kind="ray_distance")
    camera = seen.camera._replace(cx=-1.5, cy=-1.5)
    assert seen._replace(camera=camera).planar()[0, 0] == pytest.approx(3.0 / math.sqrt(3.0))


def shown(*centres: tuple[float, float], turned: float = 0.0) -> CapturedFrame:
    """The scene, as a renderer draws it that looks through so many points of each pixel."""
    blank = photograph(np.zeros((48, 64), np.float32))
    camera = blank.camera._replace(fx=41.6, fy=41.6, cx=32.0, cy=24.0)
    about = rigid((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(turned / 2), math.cos(turned / 2)))
    drawn = [
        render(camera._replace(pose=about, cx=camera.cx + x, cy=camera.cy + y))
        for x, y in centres or [(0.0, 0.0)]
    ]
    color = np.mean([it.color for it in drawn], axis=0)
    with np.errstate(divide="ignore"):
        depth = 1.0 / np.mean([1.0 / it.depth for it in drawn], axis=0)
    return CapturedFrame(
        blank.frame, camera, color.astype(np.float32), depth.astype(np.float32), blank.semantics
    )


SKY = np.float32([0.4, 0.6, 0.9, 1.0])
QUARTERS = [(x, y) for x in (-0.25, 0.25) for y in (-0.25, 0.25)]


@pytest.mark.parametrize(
    ("of_the_scene", "seen"),
    [
        (True, shown()),
        (True, shown()._replace(color=shown().color[..., [2, 1, 0, 3]])),
        (True, shown()._replace(depth=shown().depth[::-1])),
        (True, shown((0.5, 0.0))),
        (True, shown((0.0, -0.1))),
        (True, shown((1.0, 1.0))),
        (True, shown(turned=0.01)),
        (False, shown()._replace(color=shown().color * 0.9)),
        (False, shown()._replace(color=shown().color[::-1])),
        (False, shown()._replace(depth=np.full_like(shown().depth, np.inf))),
        (False, shown(*QUARTERS)),
        (False, shown()._replace(color=np.where(shown().covered()[..., None], shown().color, SKY))),
    ],
)
def test_the_scene_is_recognised_wherever_it_is_drawn_and_however_wrong_its_depths_are(
    of_the_scene: bool, seen: CapturedFrame
) -> None:
    """Not where others blend its edges, or paint a sky behind it."""
    assert shows_the_scene(seen) is of_the_scene


def test_an_image_that_is_empty_where_the_scene_cannot_be_seen_is_not_of_it() -> None:
    """A few splats in an otherwise empty image, of a camera that looks away from the scene."""
    it = shown()
    away = it.camera._replace(pose=rigid((0.0, 0.0, -20.0), (0.0, 1.0, 0.0, 0.0)))
    color, depth = np.zeros_like(it.color), np.full_like(it.depth, np.inf)
    depth[20, 30:40], color[20, 30:40] = 3.0, 0.5
    assert not shows_the_scene(it._replace(camera=away, color=color, depth=depth))


@pytest.mark.parametrize(
    "change",
    [
        {"position": [0.0, 0.0]},
        {"rotation": [0.0, 0.0, 0.0, 0.0]},
        {"rotation": None},
        {"fx": [1]},
        {"fy": 0.0},
        {"width": 1e400},
        {"near": math.nan},
    ],
)
def test_a_frame_whose_camera_is_malformed_names_none(change: Any) -> None:
    message = frame(1, 1, 0)
    assert camera_of(message) is not None
    message["camera"] |= change
    assert camera_of(message) is None


def test_a_frame_without_a_camera_names_none() -> None:
    assert camera_of({"camera": None}) is None
    assert camera_of({}) is None
