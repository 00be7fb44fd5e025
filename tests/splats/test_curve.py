"""The order in which Gaussians are kept: those that follow each other are near each other."""

from __future__ import annotations

import numpy as np
from splatbus_splats.gaussians import along_curve, curve
from splatbus_splats.made import made

from tests.splats.shots import some


def test_neighbours_follow_each_other() -> None:
    scene = made(20_000, 1)
    ordered = along_curve(scene)
    np.testing.assert_array_equal(np.sort(ordered.means, axis=0), np.sort(scene.means, axis=0))
    steps = np.linalg.norm(np.diff(ordered.means, axis=0), axis=1)
    before = np.linalg.norm(np.diff(scene.means, axis=0), axis=1)
    assert np.median(steps) < 0.05 * np.median(before)


def test_what_belongs_together_stays_together() -> None:
    scene = made(500, 2)
    scene.opacities[:] = np.linspace(0, 1, 500)
    order = curve(scene.means)
    ordered = along_curve(scene)
    for name in ("means", "rotations", "scales", "opacities", "coefficients"):
        np.testing.assert_array_equal(getattr(ordered, name), getattr(scene, name)[order])


def test_cells_follow_each_other_by_x_then_y_then_z() -> None:
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
    np.testing.assert_array_equal(curve(np.ascontiguousarray(corners[::-1]))[::-1], np.arange(8))


def test_those_of_one_place_stay_as_they_came_and_far_ones_do_no_harm() -> None:
    means = np.zeros((100, 3), np.float32)
    means[50] = 3e38
    means[51] = -3e38
    order = curve(means).tolist()
    assert order == [51, *range(50), *range(52, 100), 50]
    assert not len(curve(some(np.empty((0, 3))).means))
