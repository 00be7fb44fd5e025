"""The garden is made the same for the same seed, as trained scenes are, lit, and seen well."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from splatbus_splats.beginning import before, lens_for
from splatbus_splats.drawing.harmonics import CONSTANT, colours
from splatbus_splats.files.cameras import read_cameras
from splatbus_splats.files.read import read
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import garden, main
from splatbus_splats.made.light import TO_SUN, Shades, sheen
from splatbus_splats.made.parts import directions, part, turns_of
from splatbus_splats.scene import Frames, Scene
from splatbus_wire.rotations import rotation_matrix

ARRAYS = ("means", "rotations", "scales", "opacities", "coefficients")


@pytest.fixture(scope="module")
def scene() -> Gaussians:
    return garden(30_000)


def test_a_garden_is_made_the_same_for_the_same_seed() -> None:
    a, b, c = garden(2000), garden(2000), garden(2000, seed=2)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert not np.array_equal(getattr(a, name), getattr(c, name))


@pytest.mark.parametrize("count", [1, 2, 37, 1000])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_it_has_as_many_gaussians_and_harmonics_as_asked_for(count: int, degree: int) -> None:
    made = garden(count, degree)
    assert len(made) == count
    assert made.degree == degree
    for name in ARRAYS:
        assert getattr(made, name).dtype == np.float32
        assert np.isfinite(getattr(made, name)).all()


def test_it_has_the_statistics_of_trained_scenes(scene: Gaussians) -> None:
    sizes = np.sort(scene.scales, axis=1)
    assert sizes.min() > 0.0
    assert np.median(sizes[:, 0] / sizes[:, 1]) < 0.3  # flat
    assert (sizes[:, 2] > 4.0 * sizes[:, 1]).mean() > 0.03  # grass
    assert 0.5 < np.std(np.log(sizes[:, 2])) < 2.0
    assert (scene.opacities < 0.25).mean() > 0.1
    assert (scene.opacities > 0.75).mean() > 0.6
    assert 0.0 <= scene.opacities.min() < scene.opacities.max() <= 1.0
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1.0, atol=1e-6)
    bands = (slice(1, 4), slice(4, 9), slice(9, 16))
    powers = [np.square(scene.coefficients[:, each]).mean() for each in bands]
    assert powers[0] > powers[1] > powers[2] > 0.0
    assert sheet(scene).min() > -0.05
    assert sheet(scene).max() < 1.05


def sheet(scene: Gaussians) -> np.ndarray:
    """(N, 3), colours without what depends on the direction of sight."""
    return np.asarray(0.5 + CONSTANT * scene.coefficients[:, 0])


def test_most_of_it_is_near_the_table_and_the_sky_is_far(scene: Gaussians) -> None:
    x, z = scene.means.T[[0, 2]]
    away = np.hypot(x, z)
    assert (away < 1.8).mean() > 0.6
    assert 0.01 < (np.linalg.norm(scene.means, axis=1) > 40.0).mean() < 0.1
    for each in range(8):  # hedge and trees stand all around
        is_here = np.floor((np.arctan2(z, x) / np.pi + 1.0) * 4.0) == each
        assert ((away > 4.0) & (away < 20.0) & is_here).sum() > 0.007 * len(scene)


def test_the_table_lies_flat_and_its_far_side_from_the_sun_is_in_the_shade(
    scene: Gaussians,
) -> None:
    x, y, z = scene.means.T
    away = np.hypot(x, z)
    is_top = (np.abs(y) < 0.005) & (away > 0.5) & (away < 0.97)
    assert is_top.sum() > 1000
    a, b, c, d = scene.rotations[is_top].T
    assert np.median(2.0 * (b * c - a * d)) < -0.98  # y of what they are thin along
    toward = (scene.means[is_top] * (1.0, 0.0, 1.0)) @ TO_SUN
    bright = sheet(scene)[is_top].mean(axis=1)
    assert bright[toward > 0.3].mean() > 1.25 * bright[toward < -0.3].mean()


def test_what_is_nearer_to_the_light_takes_it_from_what_is_behind() -> None:
    random = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(np.arange(20.0), [0.0, 5.0], np.arange(20.0)), -1).reshape(-1, 3)
    up, covers = np.tile((0.0, -1.0, 0.0), (len(grid), 1)), np.full(len(grid), 1.0)
    shades = Shades(grid, up, covers, np.zeros(len(grid)))
    light = shades.light(np.array((0.0, -1.0, 0.0)), 2.0, random)
    assert light[grid[:, 1] == 0.0].min() == 1.0
    behind = light[grid[:, 1] == 5.0]
    assert behind.mean() == pytest.approx(np.exp(-1.0), abs=0.05)
    aside = shades.light(np.array((1.0, 0.0, 0.0)), 2.0, random)
    assert aside[grid[:, 0] == 19.0].min() == 1.0
    wide = shades._replace(extents=np.full(len(grid), 6.0))
    assert wide.light(np.array((0.0, -1.0, 0.0)), 2.0, random).min() == 1.0


def test_sheen_is_brightest_where_the_sun_is_mirrored() -> None:
    up = part(np.zeros((1, 3)), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), 0.1, 0.5, gloss=0.2)
    k = sheen(up, np.ones(1), 3)
    looks = directions(500, np.random.default_rng(1))
    seen = colours(np.repeat(k.transpose(1, 2, 0), len(looks), axis=2), looks)[:, 0]
    assert looks[seen.argmax()] @ (TO_SUN * (1.0, -1.0, 1.0)) > 0.95
    assert seen.max() > 0.6


def test_turns_take_x_along_and_z_to_the_normal() -> None:
    random = np.random.default_rng(1)
    normals = np.concatenate((directions(200, random), np.eye(3), -np.eye(3)))
    along = np.concatenate(
        (directions(200, random), np.roll(np.eye(3), 1, 0), np.eye(3)[[1, 2, 0]])
    )
    for turn, z, x in zip(turns_of(normals, along), normals, along, strict=True):
        matrix = np.array(rotation_matrix(tuple(turn.tolist()))).reshape(3, 3)
        np.testing.assert_allclose(matrix[:, 2], z, atol=1e-9)
        flat = x - (x @ z) * z
        np.testing.assert_allclose(matrix[:, 0], flat / np.linalg.norm(flat), atol=1e-9)


def test_without_cameras_the_view_begins_with_tree_and_table_in_it(scene: Gaussians) -> None:
    whole = Scene({"default": Frames((scene,))})
    lens = lens_for(640, 480, whole.at(None).values())
    pose, lens = before(whole, lens, 640, 480)
    for point in ((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.5, 0.0), (0.0, 0.7, 0.0)):
        x, y, z = np.subtract(point, pose.position)
        assert 2.0 < z < 5.0
        assert 0.0 < lens.fx * x / z + lens.cx < 640.0
        assert 0.0 < lens.fy * y / z + lens.cy < 480.0


def test_the_command_writes_it_and_cameras_that_look_at_it(tmp_path: Path) -> None:
    file, cameras = tmp_path / "garden.ply", tmp_path / "cameras.json"
    arguments = ["1000", str(file), "--scene", "garden", "--cameras", str(cameras)]
    assert main(arguments) == 0
    found = read(file)
    assert not found.left_out
    np.testing.assert_allclose(found.gaussians.means, garden(1000).means, atol=1e-6)
    found_cameras = read_cameras(cameras)
    assert len(found_cameras) == 8
    for each in found_cameras:
        matrix = np.array(rotation_matrix(each.pose.rotation)).reshape(3, 3)
        ahead = np.subtract((0.0, -0.5, 0.0), each.pose.position)
        np.testing.assert_allclose(matrix[:, 2], ahead / np.linalg.norm(ahead), atol=1e-9)
        assert matrix[1, 0] == pytest.approx(0.0, abs=1e-12)  # upright
        assert matrix[1, 1] > 0.8
    assert found_cameras[0].pose.position[2] < -2.0  # in front, as trained scenes are


def test_a_scene_that_is_none_and_cameras_of_the_balls_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["10", str(tmp_path / "a.ply"), "--scene", "forest"])
    assert "forest" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["10", str(tmp_path / "a.ply"), "--cameras", str(tmp_path / "cameras.json")])
    assert "--cameras is for the garden" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
