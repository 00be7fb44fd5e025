"""The ring: on its cylinder, before and behind what it surrounds."""

import numpy as np
import pytest
from splatbus_viewer.display import Shown, rays
from splatbus_viewer.mesh import _AXIS, ring_around
from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import IDENTITY

CAMERA = FrameCamera(IDENTITY, 100.0, 100.0, 60.0, 40.0, 120, 80, 0.01, 100.0)


def plane(depth):
    return Shown(np.ones((80, 120, 4), np.float32), np.full((80, 120), depth, np.float32), CAMERA)


@pytest.fixture(params=[0.5, 400.0, np.inf])
def around(request):
    color, depth = ring_around(plane(request.param))
    return (request.param if np.isfinite(request.param) else 3.0), color, depth


def test_the_ring_passes_before_and_behind(around):
    middle, color, depth = around
    covered = depth[np.isfinite(depth)]
    assert covered.min() < middle
    assert covered.max() > 1.3 * middle
    assert 100 < covered.size < depth.size / 2
    assert (color[np.isfinite(depth)] > 0).all()
    assert not color[np.isposinf(depth)].any()


def test_every_point_lies_on_the_cylinder(around):
    middle, _, depth = around
    hit = np.isfinite(depth)
    radius = 0.45 * middle
    points = depth[hit][:, None] * rays(CAMERA)[hit] - [0, 0, middle + 0.75 * radius]
    across = points - (points @ _AXIS)[:, None] * _AXIS
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), radius, rtol=1e-5)
    assert np.abs(points @ _AXIS).max() <= 0.131 * radius


def test_nothing_of_the_ring_is_before_what_is_seen_of_it(around):
    middle, _, depth = around
    hit = np.isfinite(depth)
    radius = 0.45 * middle
    z = depth[hit] * np.linspace(0.0, 0.999, 2000)[:, None]
    points = z[..., None] * rays(CAMERA)[hit] - [0, 0, middle + 0.75 * radius]
    height = points @ _AXIS
    within = np.linalg.norm(points - height[..., None] * _AXIS, axis=-1) < radius
    crossings = (within[1:] != within[:-1]) & (np.abs(height[1:]) < 0.125 * radius)
    assert not crossings.any()
