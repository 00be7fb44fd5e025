"""What the renderer does not do: nothing of it is seen, or no more than its name says."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import DataObject, booleans, data, floats, integers, lists, tuples
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing import renderer, runs
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.renderer import Renderer, rendered
from splatbus_splats.drawing.skips import EXACT, MEANINGS, NOTHING, USUAL, Skip, named
from splatbus_splats.drawing.truth import truth
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import HEIGHT, WIDTH, some, view_of

pytestmark = pytest.mark.usefixtures("loops")

ROUNDING = 2e-6
LIMIT = 1.0 / 255.0
SCENE = {"default": made(4000, 3)}
FROM_WITHIN = Pose((0.1, 0.3, 3.3), (0, 0.7, 0.1, 0.7))


def drawn(view: View, scene: Mapping[str, Gaussians], skips: Skip) -> Image:
    return rendered(placed(view, scene), view.intrinsics, view.width, view.height, 1, skips)


def exact(view: View, scene: Mapping[str, Gaussians]) -> Image:
    return truth(placed(view, scene), view.intrinsics, view.width, view.height)


@cache
def seen_from(pose: Pose) -> tuple[Image, Image]:
    """The scene when nothing is left out, and as the definition has it."""
    return drawn(view_of(pose), SCENE, NOTHING), exact(view_of(pose), SCENE)


def off_by(image: Image, other: Image) -> float:
    return float(np.abs(image.color - other.color).max())


@pytest.mark.parametrize("pose", [Pose((0, 0, 0), (0, 0, 0, 1)), FROM_WITHIN])
@pytest.mark.parametrize("skips", [NOTHING, *EXACT, EXACT], ids=str)
def test_what_is_exact_changes_nothing(skips: Skip, pose: Pose) -> None:
    image, (without, right) = drawn(view_of(pose), SCENE, skips), seen_from(pose)
    assert off_by(image, without) <= ROUNDING
    assert off_by(image, right) <= LIMIT
    np.testing.assert_allclose(image.inverse, without.inverse, atol=ROUNDING)


def test_what_is_behind_the_opaque_is_not_looked_at() -> None:
    x, y = np.meshgrid(np.linspace(-3, 3, 25), np.linspace(-3, 3, 25))
    wall = np.stack((x, y, np.full_like(x, 2.0)), axis=-1).reshape(-1, 3)
    layers = np.concatenate([np.add(wall, (0, 0, i)) for i in range(12)])
    behind = some(layers, 0.4, opacities=0.95)
    behind.coefficients[9 * len(wall) :] = np.inf  # which would be seen, even at a weight of zero
    view = view_of()
    assert np.isnan(drawn(view, {"default": behind}, NOTHING).color).any()
    image = drawn(view, {"default": behind}, Skip.HIDDEN)
    assert np.isfinite(image.color).all()
    assert (image.color[..., 3] > 0.99).all()


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


@pytest.mark.parametrize(
    ("skip", "scene"),
    [
        (Skip.OUTSIDE, some([(0, 0, 4), (0, 40, 4), (-30, 0, 4)])),
        (Skip.SMALL, some([(0, 0, 4)] * 3, [[0.1] * 3, [1e-4] * 3, [0.0] * 3])),
    ],
    ids=("outside", "small"),
)
def test_those_that_are_not_seen_are_not_drawn(
    seen: list[int], skip: Skip, scene: Gaussians
) -> None:
    for skips, count in ((skip, 1), (NOTHING, 3)):
        drawn(view_of(), {"default": scene}, skips)
        assert seen == [count]
        seen.clear()


@pytest.mark.parametrize("where", [(2.35, 0, 4), (0, 2.4, 4), (-2.35, 0, 4), (0, -2.4, 4)])
def test_one_whose_centre_is_outside_is_seen_if_it_reaches_the_image(
    where: tuple[float, float, float],
) -> None:
    # The edges are 3.46 to the side, and 2.31 above and below.
    scene = {"default": some(where, (1.0, 0.02, 1.0))}
    view = view_of(size=(WIDTH, HEIGHT))
    assert drawn(view, scene, EXACT).color.max() > 0
    assert off_by(drawn(view, scene, EXACT), exact(view, scene)) <= LIMIT


def test_an_object_of_a_scale_reaches_as_far_as_it_is_large() -> None:
    scene = {"default": some((0.47, 0, 0), 0.2)}  # 2.35 to the side, and as large as 1
    view = view_of(
        Pose((0, 0, 0), (0, 0, 0, 1)),
        Placement("default", Pose((2.4, 0, 4), (0, 0, 0, 1)), 5.0),
    )
    assert drawn(view, scene, EXACT).color.max() > 0.1
    assert off_by(drawn(view, scene, EXACT), exact(view, scene)) <= LIMIT


def test_channels_that_nobody_reads_are_not_made() -> None:
    objects, view = placed(view_of(), SCENE), view_of()
    with Renderer(1, EXACT) as one:
        whole = one.draw(objects, view.intrinsics, WIDTH, HEIGHT)
        color, inverse = whole.color.copy(), whole.inverse.copy()
        depth = one.draw(objects, view.intrinsics, WIDTH, HEIGHT, frozenset({"depth"}))
        np.testing.assert_array_equal(depth.inverse, inverse)
        np.testing.assert_array_equal(depth.color[..., 3], color[..., 3])
        assert not depth.color[..., :3].any()
        flat = one.draw(objects, view.intrinsics, WIDTH, HEIGHT, frozenset({"color"}))
        np.testing.assert_array_equal(flat.color, color)
        assert not flat.inverse.any()


def test_a_run_behind_what_is_opaque_is_not_projected(seen: list[int]) -> None:
    x, y = np.meshgrid(np.linspace(-4, 4, 64), np.linspace(-3, 3, 64))
    walls = [np.stack((x, y, np.full_like(x, z)), -1).reshape(-1, 3) for z in range(2, 12)]
    scene = {"default": some(np.concatenate(walls), 0.2, opacities=0.95)}
    view = view_of()
    image = drawn(view, scene, Skip.HIDDEN)
    assert sum(seen) <= 3 * 64 * 64
    assert off_by(image, drawn(view, scene, NOTHING)) <= ROUNDING


def test_what_is_not_in_view_does_not_spoil_the_slices(seen: list[int]) -> None:
    x, y = np.meshgrid(np.linspace(-4, 4, 64), np.linspace(-3, 3, 64))
    walls = [np.stack((x, y, np.full_like(x, z)), -1).reshape(-1, 3) for z in range(2, 12)]
    behind = np.repeat(np.array([(0.0, 0.0, -5.0)]), 3 * 10 * 64 * 64, axis=0)
    scene = {"default": some(np.concatenate(walls), 0.2, opacities=0.95), "behind": some(behind)}
    view = view_of(IDENTITY, Placement("default", IDENTITY), Placement("behind", IDENTITY))
    drawn(view, scene, EXACT)
    assert sum(seen) <= 3 * 64 * 64


def test_a_run_beside_the_image_is_not_looked_at(seen: list[int]) -> None:
    two = np.repeat([(0, 0, 4), (30, 0, 4)], runs.LENGTH, axis=0)
    drawn(view_of(), {"default": some(two, 0.01)}, Skip.OUTSIDE)
    assert seen == [runs.LENGTH]


@settings(max_examples=400, deadline=None)
@given(data())
def test_a_run_is_outlined_by_all_that_its_gaussians_reach(draw: DataObject) -> None:
    number = floats(-8, 8)
    powers = integers(-6, 3)
    means = draw.draw(lists(tuples(number, number, number), min_size=1, max_size=3))
    scene = some(means, 2.0 ** draw.draw(powers), opacities=1.0)
    pose = Pose(draw.draw(tuples(number, number, number)), (0.1, -0.5, 0.3, 0.8))
    placement = Placement("default", pose, 2.0 ** draw.draw(powers))
    lens = Intrinsics(30.0, 50.0, draw.draw(floats(-20, 120)), 40.0, 0.01, 100.0)
    view = view_of(Pose((0, 0, 0), (0, 0, 0, 1)), placement, intrinsics=lens)
    (each,) = placed(view, {"default": scene})
    found = runs.outlines(runs.bounds_of(scene), each, lens, WIDTH, HEIGHT)
    rows, columns = np.nonzero(exact(view, {"default": scene}).color[..., 3])
    if len(rows):
        left, right, top, bottom = found.boxes[0]
        assert left <= columns.min()
        assert columns.max() <= right
        assert top <= rows.min()
        assert rows.max() <= bottom


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


def test_tiles_without_a_change_are_kept(due: list[int]) -> None:
    statue = some([(0, 0, 0), (0.1, 0, 0.1)], 0.15, colors=(0.9, 0.1, 0.1))
    scene = {"default": made(3000), "statue": statue}
    with Renderer(2, EXACT) as kept:
        for x in (-1.0, -0.9, 0.5, 90.0, 0.5):
            view = view_of(
                Pose((0, 0, 0), (0, 0, 0, 1)),
                Placement("default", Pose((0, 0, 0), (0, 0, 0, 1))),
                Placement("statue", Pose((x, 0.2, 3.0), (0, 0, 0, 1))),
            )
            image = kept.draw(placed(view, scene), view.intrinsics, WIDTH, HEIGHT)
            tiles = due[0]
            afresh = drawn(view, scene, EXACT)
            np.testing.assert_array_equal(image.color, afresh.color)
            np.testing.assert_array_equal(image.inverse, afresh.inverse)
            assert tiles == 24 if x == -1.0 else 0 < tiles < 16
            due.clear()


def test_an_object_whose_count_changes_leaves_the_others_as_they_are(seen: list[int]) -> None:
    room, clip = made(3000), some(np.random.default_rng(1).normal(0, 0.1, (900, 3)), 0.03)
    with Renderer(2, EXACT) as kept:
        for number, count in enumerate((900, 700, 880, 0, 3, 900, 1)):
            view = view_of(
                IDENTITY,
                Placement("default", IDENTITY),
                Placement("clip", Pose((0, 0, 3), (0, 0, 0, 1))),
            )
            scene = {"default": room, "clip": clip[:count]}
            seen.clear()
            image = kept.draw(placed(view, scene), view.intrinsics, WIDTH, HEIGHT)
            assert (sum(seen) <= count) == (number > 0)
            afresh = drawn(view, scene, EXACT)
            np.testing.assert_array_equal(image.color, afresh.color)
            np.testing.assert_array_equal(image.inverse, afresh.inverse)


def test_after_an_image_that_failed_the_next_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    view = view_of()
    right = drawn(view, SCENE, EXACT)
    with Renderer(1, EXACT) as one:
        with monkeypatch.context() as broken:
            broken.setattr(renderer.listing, "in_tiles", Mock(side_effect=MemoryError))
            with pytest.raises(MemoryError):
                one.draw(placed(view, SCENE), view.intrinsics, WIDTH, HEIGHT)
        image = one.draw(placed(view, SCENE), view.intrinsics, WIDTH, HEIGHT)
    np.testing.assert_array_equal(image.color, right.color)


def test_a_view_that_is_as_before_costs_nothing(seen: list[int], due: list[int]) -> None:
    view = view_of()
    with Renderer(1, EXACT) as kept:
        before = kept.draw(placed(view, SCENE), view.intrinsics, WIDTH, HEIGHT).color.copy()
        seen.clear()
        due.clear()
        again = kept.draw(placed(view, SCENE), view.intrinsics, WIDTH, HEIGHT)
        np.testing.assert_array_equal(again.color, before)
        assert not seen
        assert not due


def test_where_nothing_is_hidden_it_is_not_looked_for(due: list[int]) -> None:
    around = some(np.random.default_rng(1).normal((0, 0, 4), 1, (4 * runs.LENGTH, 3)), 0.01)
    x, y = np.meshgrid(np.linspace(-3, 3, 25), np.linspace(-3, 3, 25))
    wall = np.stack((x, y, np.full_like(x, 2.0)), axis=-1).reshape(-1, 3)
    scene = {"default": around, "wall": some(np.repeat(wall, 9, axis=0), 0.4, opacities=0.95)}
    slices = len(renderer.SLICES) + 1
    with Renderer(2, EXACT) as one:
        for number, (z, expected) in enumerate(
            ((-9.0, slices), (-9.0, 1), (0.0, 1), (0.0, slices), (-9.0, slices), (-9.0, 1))
        ):
            view = view_of(
                Pose((0.01 * number, 0, 0), (0, 0, 0, 1)),
                Placement("default", Pose((0, 0, 0), (0, 0, 0, 1))),
                Placement("wall", Pose((0, 0, z), (0, 0, 0, 1))),
            )
            due.clear()
            image = one.draw(placed(view, scene), view.intrinsics, WIDTH, HEIGHT)
            assert len(due) == expected
            assert off_by(image, drawn(view, scene, NOTHING)) <= ROUNDING


@pytest.mark.parametrize("what", ["lens", "size", "channels", "gaussians", "fewer", "more"])
def test_whatever_changes_is_seen(what: str) -> None:
    view, other, scene = view_of(), view_of(), dict(SCENE)
    after, channels = dict(SCENE), renderer.CHANNELS
    if what == "lens":
        other = view_of(intrinsics=view.intrinsics._replace(fx=40.0))
    elif what == "size":
        other = view_of(size=(WIDTH, HEIGHT - 17))
    elif what == "channels":
        channels = frozenset({"color"})
    elif what == "gaussians":
        after["default"] = made(4000, 3, seed=9)
    elif what == "fewer":
        after["default"] = made(3000)
    else:
        after["default"] = made(5000)
    with Renderer(1, EXACT) as kept:
        kept.draw(placed(view, scene), view.intrinsics, view.width, view.height, channels)
        image = kept.draw(placed(other, after), other.intrinsics, other.width, other.height)
    right = drawn(other, after, EXACT)
    np.testing.assert_array_equal(image.color, right.color)
    np.testing.assert_array_equal(image.inverse, right.inverse)


@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (95, 63), (17, 1), (1, 2)])
def test_fewer_pixels_while_the_camera_moves(size: tuple[int, int], due: list[int]) -> None:
    view = view_of(size=size)
    objects = placed(view, SCENE)
    with Renderer(2, USUAL) as one:
        rough = one.draw(objects, view.intrinsics, *size, is_moving=True)
        assert due[0] == -(-((size[0] + 1) // 2) // 16) * -(-((size[1] + 1) // 2) // 16)
        rest = one.draw(objects, view.intrinsics, *size)
    right = drawn(view, SCENE, NOTHING)
    assert rough.color.shape == right.color.shape
    assert off_by(rest, right) <= ROUNDING
    assert np.sqrt(np.mean((rough.color - right.color) ** 2)) < 0.12
    assert off_by(rough, right) > ROUNDING


def test_a_coarse_image_is_where_the_fine_one_is() -> None:
    view = view_of()
    scene = {"default": some((0.4, -0.2, 4), 0.6)}
    with Renderer(1, USUAL) as one:
        rough = one.draw(
            placed(view, scene), view.intrinsics, WIDTH, HEIGHT, is_moving=True
        )  # wide and smooth: so that a shift is the only thing that could be seen
    assert off_by(rough, drawn(view, scene, EXACT)) < 0.01


def test_skips_have_names() -> None:
    assert named("hidden,Tiles") == Skip.HIDDEN | Skip.TILES
    assert named("none") == NOTHING
    assert named("usual") == USUAL
    assert named("all") == ~NOTHING
    assert named("exact") == EXACT
    assert set(MEANINGS) == {str(each.name).lower() for each in Skip}
    with pytest.raises(ValueError, match=r"'dim' is none of none, exact, usual, all, outside, h"):
        named("hidden,dim")


@settings(deadline=None)
@given(data())
def test_runs_reach_the_tiles_that_their_boxes_hold(draw: DataObject) -> None:
    down, across = 5, 7
    is_due = np.array(draw.draw(lists(booleans(), min_size=35, max_size=35))).reshape(down, across)
    numbers = integers(-160, 640).map(lambda quarters: quarters / 4)  # where 16 is no rounding
    boxes = np.array(draw.draw(lists(tuples(*[numbers] * 4), min_size=1, max_size=5)))
    tiles = runs.tiles_of(boxes, 16, across, down)
    for (left, right, top, bottom), found in zip(boxes, runs.reaching(tiles, is_due), strict=True):
        columns = [x for x in range(across) if left < 16 * (x + 1) and 16 * x <= right]
        rows = [y for y in range(down) if top < 16 * (y + 1) and 16 * y <= bottom]
        if left <= right and top <= bottom:
            assert found == any(is_due[y, x] for y in rows for x in columns)
