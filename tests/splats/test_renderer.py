"""What the compiled renderer draws is what the definition says, at every pixel."""

from __future__ import annotations

import os
import tracemalloc
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from splatbus_server.view import Intrinsics, View
from splatbus_splats.drawing import renderer
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.kernels import compiled
from splatbus_splats.drawing.renderer import rendered
from splatbus_splats.drawing.truth import at_pixels, truth
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

from tests.splats.shots import HEIGHT, WIDTH, contiguous, some, view_of

pytestmark = pytest.mark.usefixtures("loops")

LIMIT = 1.0 / 255.0
"""What the worst pixel may be off by."""
USUAL = 1e-5
"""And 999 of a thousand, which are at no cut and no tie."""
DEPTH = 1e-5
"""Relative."""


def drawn(view: View, objects: Mapping[str, Gaussians]) -> Image:
    return rendered(placed(view, objects), view.intrinsics, view.width, view.height)


def compare(
    view: View, objects: Mapping[str, Gaussians], right: Image | None = None, usual: float = USUAL
) -> Image:
    """The image, which agrees with the truth."""
    image = drawn(view, objects)
    right = right or truth(placed(view, objects), view.intrinsics, view.width, view.height)
    assert image.color.dtype == image.inverse.dtype == np.float32
    agree(image, right, usual)
    return image


def agree(image: Image, right: Image, usual: float = USUAL) -> None:
    errors = np.abs(image.color - right.color).max(axis=-1)
    alphas = right.color[..., 3]
    covered = (alphas >= LIMIT) & (image.color[..., 3] >= LIMIT)
    ours, exact = (each.color[..., 3] / each.inverse for each in (
        Image(image.color[covered], image.inverse[covered]),
        Image(right.color[covered], right.inverse[covered]),
    ))  # fmt: skip
    depth = np.abs(ours / exact - 1) if covered.any() else np.zeros(1)
    print(
        f"worst {errors.max() * 255:.6f}/255, 99.9% {np.quantile(errors, 0.999) * 255:.6f}/255,"
        f" covered {covered.mean():.0%}, depth {depth.max():.1e}, 99.9% "
        f"{np.quantile(depth, 0.999):.1e}"
    )
    assert errors.max() <= LIMIT
    assert np.quantile(errors, 0.999) <= usual
    assert np.quantile(depth, 0.999) <= max(DEPTH, usual)


@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("seed", [1, 2])
def test_made_scenes(degree: int, seed: int) -> None:
    image = compare(view_of(), {"default": made(2000, degree, seed)})
    assert (image.color[..., 3] > 0.5).mean() > 0.7


@pytest.mark.parametrize("size", [(1, 1), (16, 16), (17, 31), (33, 15), (100, 7)])
def test_images_of_any_size(size: tuple[int, int]) -> None:
    compare(view_of(size=size), {"default": made(1000)})


def test_a_lens_whose_middle_is_elsewhere() -> None:
    lens = Intrinsics(40.0, 70.0, 11.3, 58.9, 1.0, 12.0)
    compare(view_of(intrinsics=lens), {"default": made(2000)})


def test_a_camera_in_the_midst_of_it() -> None:
    for turn in ((0, 0, 0, 1), (0, 0.7, 0.1, 0.7), (0.5, 0.5, -0.5, 0.5)):
        compare(view_of(Pose((0.1, 0.3, 3.3), turn)), {"default": made(2000)})


def test_a_hundred_thousand_gaussians_at_sampled_pixels() -> None:
    view, scene = view_of(size=(640, 480)), {"default": made(100_000)}
    image = drawn(view, scene)
    columns, rows = np.random.default_rng(1).integers(0, (640, 480), (400, 2)).T
    right = at_pixels(placed(view, scene), view.intrinsics, 640, 480, columns, rows)
    agree(Image(image.color[rows, columns], image.inverse[rows, columns]), right)


def test_several_objects_are_sorted_together_each_with_its_pose_and_scale() -> None:
    view = view_of(
        Pose((0.2, -0.3, -1), (0, 0.1, 0, 1)),
        Placement("default", Pose((0, 0, 0.5), (0, 0.3, 0, 0.95)), 0.7),
        Placement("other", Pose((1, -1, 9), (0.5, 0.5, 0.5, 0.5)), 1.8),
    )
    both = {"default": made(1000, 3), "other": made(800, 1, seed=5)}
    image = compare(view, both)
    for name, each in both.items():
        assert np.abs(image.color - drawn(view, {name: each}).color).max() > 0.1


def test_one_object_of_a_scale_is_larger_ones_nearer() -> None:
    small, large = some((0, 0, 0), 0.2), some((0, 0, 0), 0.6)
    scaled = drawn(view_of(IDENTITY, Placement("default", Pose((0, 0, 4), (0, 0, 0, 1)), 3.0)),
                   {"default": small})  # fmt: skip
    plain = drawn(view_of(IDENTITY, Placement("default", Pose((0, 0, 4), (0, 0, 0, 1)))),
                  {"default": large})  # fmt: skip
    np.testing.assert_allclose(scaled.color, plain.color, atol=1e-6)
    np.testing.assert_allclose(scaled.inverse, plain.inverse, atol=1e-6)
    assert plain.color[HEIGHT // 2, WIDTH // 2, 3] > 0.5


def stressed(**arrays: object) -> Gaussians:
    scene = made(600, 3)
    return replace(scene, **{
        name: contiguous(value, getattr(scene, name).shape) for name, value in arrays.items()
    })  # fmt: skip


RANDOM = np.random.default_rng(7)
STRESS = {
    "points": stressed(scales=0),
    "one axis of nothing": stressed(scales=(0.1, 0.05, 0)),
    "huge": stressed(scales=(1e6, 1e6, 1e5)),
    "some huge": stressed(scales=10.0 ** RANDOM.uniform(-4, 8, (600, 3))),
    "as large as float32 goes": stressed(scales=3e38),
    "needles": stressed(scales=(1e4, 1e-4, 1e-4)),
    "short needles": stressed(scales=(1.0, 1e-6, 1e-6)),
    "quaternions short": stressed(rotations=made(600).rotations * 1e-12),
    "quaternions long": stressed(rotations=made(600).rotations * 1e12),
    "all transparent": stressed(opacities=0),
    "hardly there": stressed(opacities=1.2 / 255, scales=0.5),
    "hardly not there": stressed(opacities=np.nextafter(np.float32(1 / 255), 0)),
    "opaque": stressed(opacities=1),
    "nothing between": stressed(opacities=np.arange(600) % 2),
    "bright": stressed(coefficients=made(600).coefficients * 30),
}


@pytest.mark.parametrize("name", STRESS)
def test_under_stress(name: str) -> None:
    compare(view_of(), {"default": STRESS[name]})


@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9])
def test_far_from_the_origin_it_looks_as_at_the_origin(distance: float) -> None:
    at = (distance, -2 * distance, 0.5 * distance)
    turn = (0, 0.25, 0, 1)
    far = view_of(Pose(at, turn), Placement("default", Pose(at, (0, 0, 0, 1))))
    near = view_of(Pose((0, 0, 0), turn))
    scene = {"default": made(1500)}
    image = compare(far, scene)
    right = truth(placed(near, scene), near.intrinsics, WIDTH, HEIGHT)
    agree(image, right)


def test_gaussians_that_were_stored_far_from_the_origin() -> None:
    shift = np.array((1e6, -1e6, 1e6), np.float32)
    scene = made(1500)
    moved = replace(scene, means=scene.means + shift)
    camera = (1e6 + 0.013, -1e6 - 0.021, 1e6 + 0.009)  # between two numbers of float32
    compare(view_of(Pose(camera, (0, 0, 0, 1))), {"default": moved})


def test_of_equal_depths_the_first_is_in_front() -> None:
    for colors in ([(1, 0, 0), (0, 0, 1)], [(0, 0, 1), (1, 0, 0)]):
        both = some([(0, 0, 2), (0, 0, 2)], 20, 0.9, colors)
        first = int(np.argmax(drawn(view_of(), {"default": both}).color[5, 5]))
        assert first in (int(np.argmax(colors[0])), 3)
        compare(view_of(), {"default": both})
        compare(view_of(IDENTITY, Placement("default", IDENTITY), Placement("b", IDENTITY)),
                {"default": both, "b": some((0, 0, 2), 20, 0.9, (0, 1, 0))})  # fmt: skip


@pytest.mark.parametrize("most", [1, 3000, 10_000])
def test_lists_that_are_made_in_parts_draw_the_same(
    monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    view, scene = view_of(), {"default": made(3000)}
    whole = drawn(view, scene)
    monkeypatch.setattr(renderer, "MOST_LISTED", most)
    for threads in (1, 2):
        part = rendered(placed(view, scene), view.intrinsics, WIDTH, HEIGHT, threads)
        np.testing.assert_array_equal(part.color, whole.color)
        np.testing.assert_array_equal(part.inverse, whole.inverse)


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


def test_a_million_in_one_tile() -> None:
    means = np.zeros((1_000_000, 3), np.float32)
    means[:, 2] = np.random.default_rng(4).uniform(2, 3, 1_000_000)
    view = view_of(size=(16, 16))
    image = drawn(view, {"default": some(means, 50.0, 1.5 / 255, (0.2, 0.4, 0.9))})
    alpha = np.float32(1.5 / 255)  # a pixel is finished as soon as 1/10000 would be left
    left = (1.0 - float(alpha)) ** np.floor(np.log(1e-4) / np.log1p(-float(alpha)))
    right = (1.0 - left) * np.array((0.2, 0.4, 0.9, 1.0))
    np.testing.assert_allclose(image.color, np.broadcast_to(right, (16, 16, 4)), atol=1e-4)


def test_depths_that_float32_cannot_tell_apart_are_in_their_order() -> None:
    nearer = float(np.nextafter(np.float32(2), np.float32(0)))
    both = some([(0, 0, 2), (0, 0, nearer)], 2000, 0.9, [(1, 0, 0), (0, 0, 1)])
    lens = Intrinsics(50.0, 50.0, WIDTH / 2, HEIGHT / 2, far=2000.0)
    view = view_of(Pose((0, 0, -1000), (0, 0, 0, 1)), intrinsics=lens)
    color = compare(view, {"default": both}).color[HEIGHT // 2, WIDTH // 2]
    assert color[2] > 5 * color[0]


def test_two_that_leave_no_light_leave_none_to_a_third() -> None:
    """By rounding, two of 0.99 in float64 would leave just as much as is gone on with."""
    walls = some([(0, 0, 2), (0, 0, 4), (0, 0, 6)], 50.0, 1.0, [(0, 0, 0), (1, 1, 1), (1, 1, 1)])
    compare(view_of(), {"default": walls})


@pytest.mark.parametrize("objects", [{}, {"default": made(5)[:0]}, {"default": some((0, 0, -3))}])
def test_nothing_is_drawn_where_nothing_is(objects: dict[str, Gaussians]) -> None:
    image = rendered(placed(view_of(), objects), view_of().intrinsics, WIDTH, HEIGHT, 2)
    assert not image.color.any()
    assert not image.inverse.any()


def test_a_gaussian_at_the_cameras_very_centre_is_not_seen() -> None:
    scene = some([(0, 0, 0), (0, 0, 3)])
    np.testing.assert_array_equal(
        drawn(view_of(), {"default": scene}).color, drawn(view_of(), {"default": scene[1:]}).color
    )


def test_what_was_compiled_with_other_numbers_is_forgotten(tmp_path: Path) -> None:
    former, newer = tmp_path / "blend.nbi", tmp_path / "project.nbi"
    former.touch()
    newer.touch()
    os.utime(former, (0, 0))
    compiled._drop_older(tmp_path)
    assert not former.exists()
    assert newer.exists()


@pytest.mark.parametrize("threads", [1, 2, 3, 50])
def test_it_draws_the_same_bits_again_with_any_number_of_threads(threads: int) -> None:
    view, scene = view_of(), {"default": made(3000)}
    first = drawn(view, scene)
    second = rendered(placed(view, scene), view.intrinsics, WIDTH, HEIGHT, threads)
    np.testing.assert_array_equal(first.color, second.color)
    np.testing.assert_array_equal(first.inverse, second.inverse)
