"""What the renderer does not do: nothing of it is seen, or no more than its name says."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import DataObject, data, floats, integers, lists, tuples
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing import renderer, runs
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.renderer import Renderer
from splatbus_splats.drawing.skips import EXACT, MEANINGS, NOTHING, USUAL, Skip, named
from splatbus_splats.gaussians import Gaussians
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import HEIGHT, UNTURNED, WIDTH, alike, cloud, drawn, exact, some, view_of
from tests.splats.shots import walls as walls_of

pytestmark = pytest.mark.usefixtures("loops")

ROUNDING, LIMIT = 2e-6, 1.0 / 255.0
FRONT, SCENE = view_of(), {"default": cloud(4000)}
ONCE = {"default": some((0.47, 0, 0), 0.2)}
REACHING = {
    "front": (FRONT, SCENE),
    "amid": (view_of(Pose((0.1, 0.3, 3.3), (0, 0.7, 0.1, 0.7))), SCENE),
    # The edges are 3.46 to the side, and 2.31 above and below.
    "from beside": (FRONT, {"default": some([(2.35, 0, 4), (-2.35, 0, 4)], (1.0, 0.02, 1.0))}),
    "from above": (FRONT, {"default": some([(0, 2.4, 4), (0, -2.4, 4)], (1.0, 0.02, 1.0))}),
    "a scale": (view_of(IDENTITY, Placement("default", Pose((2.4, 0, 4), UNTURNED), 5.0)), ONCE),
}


def draw(one: Renderer, view: View, scene: dict[str, Gaussians], **options: Any) -> Image:
    lens = (view.intrinsics, view.width, view.height)
    return one.draw(placed(view, scene), *lens, **options)


def off_by(image: Image, other: Image) -> float:
    return float(np.abs(image.color - other.color).max())


@pytest.mark.parametrize("name", REACHING)
@pytest.mark.parametrize("skips", [NOTHING, *EXACT, EXACT], ids=str)
def test_what_is_exact_changes_nothing(skips: Skip, name: str) -> None:
    view, scene = REACHING[name]
    image, without = drawn(view, scene, skips), drawn(view, scene, NOTHING)
    assert image.color.max() > 0.1
    assert off_by(image, without) <= ROUNDING
    assert off_by(image, exact(view, scene)) <= LIMIT
    np.testing.assert_allclose(image.inverse, without.inverse, atol=ROUNDING)


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many Gaussians were let through, by the runs that were looked at together."""
    found: list[int] = []
    project = renderer.project.project

    def counting(*given: Any) -> None:
        tuples = [each for each in given if isinstance(each, tuple)]
        assert all(np.isscalar(number) for each in tuples for number in each), "see `project`"
        project(*given)
        table, counts = given[12:14]
        found.append(int(counts[table[:, 0]].sum()))

    monkeypatch.setattr(renderer.project, "project", counting)
    return found


@pytest.fixture
def due(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many tiles were unfinished, before each slice of depth."""
    counts: list[int] = []
    count_tiles = renderer.listing.count_tiles

    def counting(tiles: Any, across: int, is_due: Any, listed: Any) -> None:
        counts.append(int(is_due.sum()))
        count_tiles(tiles, across, is_due, listed)

    monkeypatch.setattr(renderer.listing, "count_tiles", counting)
    return counts


RUN = runs.LENGTH
WALLS = {"default": some(walls_of(10), 0.2, opacities=0.95)}
BEHIND = WALLS | {"other": some(np.tile((0.0, 0.0, -5.0), (30 * RUN, 1)))}
TWO = view_of(IDENTITY, Placement("default", IDENTITY), Placement("other", IDENTITY))


@pytest.mark.parametrize(
    ("skips", "view", "scene", "most"),
    [
        (Skip.OUTSIDE, FRONT, {"default": some([(0, 0, 4), (0, 40, 4), (-30, 0, 4)])}, 1),
        (Skip.SMALL, FRONT,
         {"default": some([(0, 0, 4)] * 3, [[0.1] * 3, [1e-4] * 3, [0] * 3])}, 1),
        (Skip.OUTSIDE, FRONT,
         {"default": some(np.repeat([(0, 0, 4), (30, 0, 4)], RUN, axis=0), 0.01)}, RUN),
        (Skip.HIDDEN, FRONT, WALLS, 3 * 64 * 64),
        (EXACT, TWO, BEHIND, 3 * 64 * 64),
    ],
    ids=["beside", "small", "a run beside", "runs behind the opaque", "others out of view"],
)  # fmt: skip
def test_those_that_are_not_seen_are_not_drawn(
    seen: list[int], skips: Skip, view: View, scene: dict[str, Gaussians], most: int
) -> None:
    image = drawn(view, scene, skips)
    assert 0 < sum(seen) <= most
    off = off_by(image, drawn(view, scene, NOTHING))
    assert skips == Skip.SMALL or off <= ROUNDING
    assert sum(seen) > 2 * most


def test_what_is_behind_the_opaque_is_not_blended() -> None:
    behind = some(walls_of(12, 25), 0.4, opacities=0.95)
    behind.coefficients[9 * 625 :] = np.inf  # which would be seen, even at a weight of zero
    assert np.isnan(drawn(FRONT, {"default": behind}, NOTHING).color).any()
    assert np.isfinite(drawn(FRONT, {"default": behind}, Skip.HIDDEN).color).all()


def test_channels_that_nobody_reads_are_not_made() -> None:
    whole = drawn(FRONT, SCENE)
    with Renderer(1, EXACT) as one:
        depth = draw(one, FRONT, SCENE, channels=frozenset({"depth"}))
        np.testing.assert_array_equal(depth.inverse, whole.inverse)
        np.testing.assert_array_equal(depth.color[..., 3], whole.color[..., 3])
        assert not depth.color[..., :3].any()
        flat = draw(one, FRONT, SCENE, channels=frozenset({"color"}))
        np.testing.assert_array_equal(flat.color, whole.color)
        assert not flat.inverse.any()


@settings(max_examples=400, deadline=None)
@given(data())
def test_a_run_is_outlined_by_all_that_its_gaussians_reach(drawing: DataObject) -> None:
    number = floats(-8, 8)
    powers = integers(-6, 3)
    means = drawing.draw(lists(tuples(number, number, number), min_size=1, max_size=3))
    scene = some(means, 2.0 ** drawing.draw(powers), opacities=1.0)
    pose = Pose(drawing.draw(tuples(number, number, number)), (0.1, -0.5, 0.3, 0.8))
    lens = Intrinsics(30.0, 50.0, drawing.draw(floats(-20, 120)), 40.0, 0.01, 100.0)
    placement = Placement("default", pose, 2.0 ** drawing.draw(powers))
    view = view_of(IDENTITY, placement, intrinsics=lens)
    (each,) = placed(view, {"default": scene})
    found = runs.outlines(runs.bounds_of(scene), each, lens, WIDTH, HEIGHT)
    rows, columns = np.nonzero(exact(view, {"default": scene}).color[..., 3])
    if len(rows):
        left, right, top, bottom = found.boxes[0]
        assert left <= columns.min() <= columns.max() <= right
        assert top <= rows.min() <= rows.max() <= bottom


def statue_at(x: float) -> View:
    moved = Placement("statue", Pose((x, 0.2, 3.0), UNTURNED))
    return view_of(IDENTITY, Placement("default", IDENTITY), moved)


def test_tiles_without_a_change_are_kept(due: list[int]) -> None:
    statue = some([(0, 0, 0), (0.1, 0, 0.1)], 0.15, colors=(0.9, 0.1, 0.1))
    scene = {"default": cloud(3000), "statue": statue}
    with Renderer(2, EXACT) as kept:
        for x in (-1.0, -0.9, 0.5, 90.0, 0.5):
            image = draw(kept, statue_at(x), scene)
            tiles = due[0]
            alike(image, drawn(statue_at(x), scene))
            assert tiles == 24 if x == -1.0 else 0 < tiles < 16
            due.clear()


def test_a_view_that_is_as_before_costs_nothing(seen: list[int], due: list[int]) -> None:
    with Renderer(1, EXACT) as kept:
        draw(kept, FRONT, SCENE)
        seen.clear()
        due.clear()
        again = draw(kept, FRONT, SCENE)
        assert seen == due == []
        alike(again, drawn(FRONT, SCENE))


@pytest.mark.parametrize(
    ("view", "scene", "options"),
    [
        (view_of(intrinsics=FRONT.intrinsics._replace(fx=40.0)), SCENE, {}),
        (view_of(size=(WIDTH, HEIGHT - 17)), SCENE, {}),
        (FRONT, SCENE, {"channels": frozenset({"color"})}),
        (FRONT, {"default": cloud(4000, seed=9)}, {}),
        (FRONT, {"default": cloud(3000)}, {}),
        (FRONT, {"default": cloud(5000)}, {}),
        (TWO, SCENE | {"other": cloud(500)}, {}),
    ],
    ids=["lens", "size", "channels", "gaussians", "fewer", "more", "one more"],
)
def test_whatever_changes_is_seen(view: View, scene: Any, options: Any) -> None:
    with Renderer(1, EXACT) as kept:
        draw(kept, FRONT, SCENE, **options)
        alike(draw(kept, view, scene), drawn(view, scene))
        alike(draw(kept, FRONT, SCENE), drawn(FRONT, SCENE))


def test_after_an_image_that_failed_the_next_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    with Renderer(1, EXACT) as one:
        with monkeypatch.context() as broken:
            broken.setattr(renderer.listing, "in_tiles", Mock(side_effect=MemoryError))
            with pytest.raises(MemoryError):
                draw(one, FRONT, SCENE)
        alike(draw(one, FRONT, SCENE), drawn(FRONT, SCENE))


@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (95, 63), (17, 1), (1, 2)])
def test_fewer_pixels_while_the_camera_moves(size: tuple[int, int], due: list[int]) -> None:
    view = view_of(size=size)
    with Renderer(2, USUAL) as one:
        rough = draw(one, view, SCENE, is_moving=True)
        assert due[0] == -(-((size[0] + 1) // 2) // 16) * -(-((size[1] + 1) // 2) // 16)
        rest = draw(one, view, SCENE)
    right = drawn(view, SCENE, NOTHING)
    assert rough.color.shape == right.color.shape
    assert off_by(rest, right) <= ROUNDING < off_by(rough, right)


def test_a_coarse_image_is_where_the_fine_one_is() -> None:
    """Of what is wide and smooth, so that a shift is the only thing that could be seen."""
    scene = {"default": some((0.4, -0.2, 4), 0.6)}
    with Renderer(1, USUAL) as one:
        rough = draw(one, FRONT, scene, is_moving=True)
    assert off_by(rough, drawn(FRONT, scene)) < 0.01


def test_skips_have_names() -> None:
    assert named("hidden,Tiles") == Skip.HIDDEN | Skip.TILES
    assert [named(each) for each in ("none", "usual", "all")] == [NOTHING, USUAL, ~NOTHING]
    assert set(MEANINGS) == {str(each.name).lower() for each in Skip}
    with pytest.raises(
        ValueError, match=r"'dim': give names of none, exact, usual, all, outside, h"
    ):
        named("hidden,dim")
