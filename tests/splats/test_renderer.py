"""What the compiled renderer draws is what the definition says, at every pixel."""

from __future__ import annotations

import os
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing import renderer
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.kernels import compiled
from splatbus_splats.drawing.truth import at_pixels
from splatbus_splats.gaussians import Gaussians
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import (
    HEIGHT,
    UNTURNED,
    WIDTH,
    alike,
    cloud,
    contiguous,
    drawn,
    exact,
    some,
    view_of,
)

pytestmark = pytest.mark.usefixtures("loops")

LIMIT = 1.0 / 255.0
"""What the worst pixel may be off by."""
USUAL = 1e-5
"""And 999 of a thousand, which are at no cut and no tie; of depth, relative."""
FRONT, RANDOM = view_of(), np.random.default_rng(7)
AMID = [(0, 0.7, 0.1, 0.7), (0.5, 0.5, -0.5, 0.5)]
PLACED = view_of(
    Pose((0.2, -0.3, -1), (0, 0.1, 0, 1)),
    Placement("default", Pose((0, 0, 0.5), (0, 0.3, 0, 0.95)), 0.7),
    Placement("other", Pose((1, -1, 9), (0.5, 0.5, 0.5, 0.5)), 1.8),
)
TWO = view_of(IDENTITY, Placement("default", IDENTITY), Placement("other", IDENTITY))
AWAY = (1e9, -2e9, 0.5e9)
FAR = view_of(Pose(AWAY, (0, 0.25, 0, 1)), Placement("default", Pose(AWAY, UNTURNED)))
SHIFT = np.array((1e6, -1e6, 1e6), np.float32)
SHIFTED = replace(cloud(1500), means=cloud(1500).means + SHIFT)
BETWEEN = Pose((1e6 + 0.013, -1e6 - 0.021, 1e6 + 0.009), UNTURNED)
"""A place between two numbers of float32."""
NEARER = float(np.nextafter(np.float32(2), np.float32(0)))
COLORS = [(1, 0, 0), (0, 0, 1)]
BACK = view_of(
    Pose((0, 0, -1000), UNTURNED), intrinsics=Intrinsics(50.0, 50.0, WIDTH / 2, HEIGHT / 2, far=2e3)
)


def stressed(**arrays: object) -> dict[str, Gaussians]:
    scene = cloud(600)
    changed = {
        name: contiguous(value, getattr(scene, name).shape) for name, value in arrays.items()
    }
    return {"default": replace(scene, **changed)}


CASES: dict[str, tuple[View, dict[str, Gaussians]]] = {
    **{f"degree {i}": (FRONT, {"default": cloud(2000, i)}) for i in range(4)},
    **{
        f"{width}x{height}": (view_of(size=(width, height)), {"default": cloud(1000)})
        for width, height in ((1, 1), (16, 16), (17, 31), (33, 15), (100, 7))
    },
    "a lens whose middle is elsewhere": (
        view_of(intrinsics=Intrinsics(40.0, 70.0, 11.3, 58.9, 1.0, 12.0)),
        {"default": cloud(2000)},
    ),
    **{
        f"amid, {turn}": (view_of(Pose((0.1, 0.3, 3.3), turn)), {"default": cloud(2000)})
        for turn in AMID
    },
    "several objects": (PLACED, {"default": cloud(1000), "other": cloud(800, 1, seed=5)}),
    "far from the origin": (FAR, {"default": cloud(1500)}),
    "stored far from the origin": (view_of(BETWEEN), {"default": SHIFTED}),
    "of equal depths the first": (
        TWO,
        {
            "default": some([(0, 0, 2)] * 2, 20, 0.9, COLORS),
            "other": some((0, 0, 2), 20, 0.9, (0, 1, 0)),
        },
    ),
    "depths that float32 cannot tell apart": (
        BACK,
        {"default": some([(0, 0, 2), (0, 0, NEARER)], 2000, 0.9, COLORS)},
    ),
    "two that leave no light to a third": (
        FRONT,
        {"default": some([(0, 0, z) for z in (2, 4, 6)], 50.0, 1.0, [(0, 0, 0), *[(1, 1, 1)] * 2])},
    ),
    "at the camera's very centre": (FRONT, {"default": some([(0, 0, 0), (0, 0, 3)])}),
    "nothing": (FRONT, {}),
    "none": (FRONT, {"default": cloud(5)[:0]}),
    "behind": (FRONT, {"default": some((0, 0, -3))}),
    "points": (FRONT, stressed(scales=0)),
    "one axis of nothing": (FRONT, stressed(scales=(0.1, 0.05, 0))),
    "huge": (FRONT, stressed(scales=(1e6, 1e6, 1e5))),
    "some huge": (FRONT, stressed(scales=10.0 ** RANDOM.uniform(-4, 8, (600, 3)))),
    "as large as float32 goes": (FRONT, stressed(scales=3e38)),
    "needles": (FRONT, stressed(scales=(1e4, 1e-4, 1e-4))),
    "quaternions of any norm": (FRONT, stressed(rotations=cloud(600).rotations * 1e-12)),
    "transparent": (FRONT, stressed(opacities=0)),
    "hardly there": (FRONT, stressed(opacities=1.2 / 255, scales=0.5)),
    "hardly not there": (FRONT, stressed(opacities=np.nextafter(np.float32(1 / 255), 0))),
    "opaque": (FRONT, stressed(opacities=1)),
    "bright": (FRONT, stressed(coefficients=cloud(600).coefficients * 30)),
}
EMPTY = {"nothing", "none", "behind", "transparent", "hardly not there"}


def agree(image: Image, right: Image) -> None:
    errors = np.abs(image.color - right.color).max(axis=-1)
    covered = (right.color[..., 3] >= LIMIT) & (image.color[..., 3] >= LIMIT)
    with np.errstate(all="ignore"):
        ours, exact = (each.color[..., 3] / each.inverse for each in (image, right))
        depth = np.abs(ours / exact - 1)[covered]
    assert errors.max() <= LIMIT
    assert np.quantile(errors, 0.999) <= USUAL
    assert np.quantile(depth, 0.999) <= USUAL if len(depth) else not covered.any()


@pytest.mark.parametrize("name", CASES)
def test_a_picture_is_the_definition(name: str) -> None:
    image, right = drawn(*CASES[name]), exact(*CASES[name])
    assert image.color.dtype == image.inverse.dtype == np.float32
    assert bool(right.color.any()) is (name not in EMPTY)
    agree(image, right)


def test_a_hundred_thousand_at_sampled_pixels() -> None:
    view, scene = view_of(size=(640, 480)), {"default": cloud(100_000)}
    image = drawn(view, scene)
    columns, rows = np.random.default_rng(1).integers(0, (640, 480), (400, 2)).T
    right = at_pixels(placed(view, scene), view.intrinsics, 640, 480, columns, rows)
    agree(Image(image.color[rows, columns], image.inverse[rows, columns]), right)


@pytest.mark.parametrize("most", [1, 3000, renderer.MOST_LISTED])
def test_the_bits_depend_on_no_number_of_threads_and_lists(
    monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    scene = {"default": cloud(3000)}
    whole = drawn(FRONT, scene)
    monkeypatch.setattr(renderer, "MOST_LISTED", most)
    for threads in (1, 2, 50):
        alike(drawn(FRONT, scene, threads=threads), whole)


def test_huge_gaussians_take_the_memory_of_a_row_of_tiles(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    view, scene = view_of(size=(320, 480)), {"default": some(np.full((3000, 3), 5.0), 100.0)}

    def peak() -> int:
        tracemalloc.start()
        drawn(view, scene)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    drawn(view, scene)
    whole = peak()
    monkeypatch.setattr(renderer, "MOST_LISTED", 1)
    assert peak() < whole - 0.9 * 4 * 3000 * 20 * (30 / renderer.PARTS - 1)  # one row of 30


def test_what_was_compiled_with_other_numbers_is_forgotten(tmp_path: Path) -> None:
    former, newer = tmp_path / "blend.nbi", tmp_path / "project.nbi"
    former.touch()
    newer.touch()
    os.utime(former, (0, 0))
    compiled._drop_older(tmp_path)
    assert not former.exists()
    assert newer.exists()
