"""Scenes are made the same for the same seed, with the statistics of trained ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from splatbus_splats.made import made, main


def test_a_scene_is_made_the_same_for_the_same_seed(tmp_path: Path) -> None:
    a, b, c = (tmp_path / name for name in ("a.ply", "b.ply", "c.ply"))
    assert main(["1000", str(a)]) == main(["1000", str(b)]) == 0
    assert main(["1000", str(c), "--seed", "2"]) == 0
    assert a.read_bytes() == b.read_bytes() != c.read_bytes()


def test_a_made_scene_has_the_statistics_of_trained_ones() -> None:
    scene = made(20_000)
    flatness = np.sort(scene.scales, axis=1)
    assert np.median(flatness[:, 0] / flatness[:, 1]) < 0.25
    low, high = (scene.opacities < 0.25).mean(), (scene.opacities > 0.75).mean()
    assert low > 0.2
    assert high > 0.5
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1, atol=1e-6)
    powers = [np.square(scene.coefficients[:, band]).mean() for band in (1, 4, 9)]
    assert powers[0] > powers[1] > powers[2] > 0


def test_flat_gaussians_lie_on_their_surface() -> None:
    scene = made(20_000)
    is_floor = np.abs(scene.means[:, 1] - 1) < 1e-6
    x, y, z, w = scene.rotations[is_floor].T
    thin = np.stack((2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)), axis=1)
    assert len(thin) > 5_000
    np.testing.assert_allclose(thin, np.broadcast_to((0, -1, 0), thin.shape), atol=1e-5)


@pytest.mark.parametrize(
    "arguments", [["0", "a.ply"], ["ten", "a.ply"], ["5", "a.ply", "--degree", "4"]]
)
def test_wrong_usage_ends_with_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)


def test_another_kind_of_file_is_not_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["5", str(tmp_path / "a.obj")])
    assert "neither .ply nor .splat" in capsys.readouterr().err
