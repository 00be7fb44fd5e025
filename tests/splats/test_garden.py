"""The garden is made the same for the same seed, as trained scenes are, lit, and seen well."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.files.cameras import read_cameras
from splatbus_splats.files.read import read
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import garden, poses
from splatbus_splats.made.__main__ import main
from splatbus_splats.made.light import TO_SUN
from splatbus_splats.made.parts import directions, turns_of
from splatbus_wire.rotations import rotation_matrix

ARRAYS = [each.name for each in fields(Gaussians)]


@pytest.fixture(scope="module")
def scene() -> Gaussians:
    return garden(30_000)


@pytest.mark.parametrize("count", [1, 2, 37, 1000])
def test_it_is_the_same_for_the_same_seed(count: int) -> None:
    one, again, other = (garden(count, seed) for seed in (1, 1, 2))
    assert (len(one), one.degree) == (count, 3)
    for name in ARRAYS:
        assert getattr(one, name).dtype == np.float32
        assert np.isfinite(getattr(one, name)).all()
        np.testing.assert_array_equal(getattr(one, name), getattr(again, name))
        assert not np.array_equal(getattr(one, name), getattr(other, name))


def test_it_has_the_statistics_of_trained_scenes(scene: Gaussians) -> None:
    sizes = np.sort(scene.scales, axis=1)
    assert sizes.min() > 0.0
    assert np.median(sizes[:, 0] / sizes[:, 1]) < 0.3  # flat
    assert (sizes[:, 2] > 4.0 * sizes[:, 1]).mean() > 0.03  # grass
    assert 0.5 < np.std(np.log(sizes[:, 2])) < 2.0
    assert (scene.opacities < 0.25).mean() > 0.1
    assert (scene.opacities > 0.75).mean() > 0.6
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1.0, atol=1e-6)
    bands = (slice(1, 4), slice(4, 9), slice(9, 16))
    powers = [np.square(scene.coefficients[:, each]).mean() for each in bands]
    assert powers[0] > powers[1] > powers[2] > 0.0


def test_the_table_lies_flat_and_its_far_side_from_the_sun_is_in_the_shade(
    scene: Gaussians,
) -> None:
    x, y, z = scene.means.T
    is_top = (np.abs(y) < 0.005) & (np.hypot(x, z) > 0.5) & (np.hypot(x, z) < 0.97)
    assert is_top.sum() > 1000
    a, b, c, d = scene.rotations[is_top].T
    assert np.median(2.0 * (b * c - a * d)) < -0.98  # y of what they are thin along
    toward = (scene.means[is_top] * (1.0, 0.0, 1.0)) @ TO_SUN
    bright = (0.5 + CONSTANT * scene.coefficients[is_top, 0]).mean(axis=1)
    assert bright[toward > 0.3].mean() > 1.25 * bright[toward < -0.3].mean()


def test_turns_take_x_along_and_z_to_the_normal() -> None:
    random, axes = np.random.default_rng(1), np.eye(3)
    normals = np.concatenate((directions(200, random), axes, -axes))
    along = np.concatenate((directions(200, random), np.roll(axes, 1, 0), axes[[1, 2, 0]]))
    for turn, z, x in zip(turns_of(normals, along), normals, along, strict=True):
        matrix = np.reshape(rotation_matrix(tuple(turn.tolist())), (3, 3))
        np.testing.assert_allclose(matrix[:, 2], z, atol=1e-9)
        flat = x - (x @ z) * z
        np.testing.assert_allclose(matrix[:, 0], flat / np.linalg.norm(flat), atol=1e-9)


def test_the_command_writes_it_and_cameras_that_look_at_it(tmp_path: Path) -> None:
    file, cameras = tmp_path / "garden.ply", tmp_path / "cameras.json"
    assert main(["1000", str(file), "--cameras", str(cameras)]) == 0
    np.testing.assert_allclose(read(file).gaussians.means, garden(1000).means, atol=1e-6)
    for each, pose in zip(read_cameras(cameras), poses(), strict=True):
        assert np.abs(np.dot(each.pose.rotation, pose.rotation)) == pytest.approx(1.0)
        matrix = np.reshape(rotation_matrix(pose.rotation), (3, 3))
        ahead = np.subtract((0.0, -0.5, 0.0), each.pose.position)
        np.testing.assert_allclose(matrix[:, 2], ahead / np.linalg.norm(ahead), atol=1e-9)
        assert matrix[1, 0] == pytest.approx(0.0, abs=1e-12)  # upright
        assert matrix[1, 1] > 0.8


@pytest.mark.parametrize("words", [("0", "a.ply"), ("ten", "a.ply"), ("5", "a.obj")])
def test_wrong_usage_is_refused(words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main([*words])


def test_where_nothing_can_be_written_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["5", str(tmp_path / "no" / "a.ply")]) == 1
    assert "No such file or directory" in capsys.readouterr().err
