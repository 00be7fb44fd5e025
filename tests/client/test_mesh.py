"""The ring: on its cylinder, before and behind what it surrounds."""

import numpy as np
import pytest
from splatbus_client.display import Shown, rays
from splatbus_client.mesh import _AXIS, ring_around
from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import IDENTITY

CAMERA = FrameCamera(IDENTITY, 100.0, 100.0, 60.0, 40.0, 120, 80, 0.01, 100.0)


def plane(depth):
    return Shown(np.ones((80, 120, 4), np.float32), np.full((80, 120), depth, np.float32), CAMERA)


@pytest.fixture(params=[0.5, 3.0, 400.0])
def drawn(request):
    color, depth = ring_around(plane(request.param))
    return request.param, color, depth


def test_the_ring_passes_before_and_behind(drawn):
    middle, _, depth = drawn
    covered = depth[np.isfinite(depth)]
    assert covered.min() < middle
    assert covered.max() > 1.3 * middle
    assert 100 < covered.size < depth.size / 2


def test_every_point_lies_on_the_cylinder(drawn):
    middle, _, depth = drawn
    hit = np.isfinite(depth)
    radius = 0.45 * middle
    points = depth[hit][:, None] * rays(CAMERA)[hit] - [0, 0, middle + 0.75 * radius]
    across = points - (points @ _AXIS)[:, None] * _AXIS
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), radius, rtol=1e-5)
    assert np.abs(points @ _AXIS).max() <= 0.131 * radius


def test_nothing_of_the_ring_is_before_what_is_seen_of_it(drawn):
    middle, _, depth = drawn
    hit = np.isfinite(depth)
    radius = 0.45 * middle
    z = depth[hit] * np.linspace(0.0, 0.999, 2000)[:, None]
    points = z[..., None] * rays(CAMERA)[hit] - [0, 0, middle + 0.75 * radius]
    height = points @ _AXIS
    within = np.linalg.norm(points - height[..., None] * _AXIS, axis=-1) < radius
    crossings = (within[1:] != within[:-1]) & (np.abs(height[1:]) < 0.125 * radius)
    assert not crossings.any()


def test_what_is_not_the_ring_is_infinitely_far_and_black(drawn):
    _, color, depth = drawn
    assert not color[np.isposinf(depth)].any()
    assert (color[np.isfinite(depth)] > 0).all()


def test_a_ring_around_nothing_is_drawn_all_the_same():
    _, depth = ring_around(plane(np.inf))
    assert np.isfinite(depth).any()
