"""The ring: on its cylinder, before and behind what it surrounds."""

from itertools import pairwise

import numpy as np
import pytest
from splatbus_viewer.display import Shown, composed, rays
from splatbus_viewer.mesh import _AXIS, bound, drawn, ring_around, tilted
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.poses import IDENTITY, Pose, as_array
from splatbus_wire.relative import object_to_camera
from splatbus_wire.semantics import Semantics

CAMERA = FrameCamera(IDENTITY, 100.0, 100.0, 60.0, 40.0, 120, 80, 0.01, 100.0)


def plane(depth):
    return Shown(np.ones((80, 120, 4), np.float32), np.full((80, 120), depth, np.float32), CAMERA)


@pytest.fixture(params=[0.5, 3.0, 400.0])
def around(request):
    color, depth = ring_around(plane(request.param))
    return request.param, color, depth


def test_the_ring_passes_before_and_behind(around):
    middle, _, depth = around
    covered = depth[np.isfinite(depth)]
    assert covered.min() < middle
    assert covered.max() > 1.3 * middle
    assert 100 < covered.size < depth.size / 2


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


def test_what_is_not_the_ring_is_infinitely_far_and_black(around):
    _, color, depth = around
    assert not color[np.isposinf(depth)].any()
    assert (color[np.isfinite(depth)] > 0).all()


def test_a_ring_around_nothing_is_drawn_all_the_same():
    _, depth = ring_around(plane(np.inf))
    assert np.isfinite(depth).any()


# A ring that is bound to an object, among splats that are the object: a ball


WIDE = FrameCamera(
    Pose((0.3, -0.2, -5.0), (0.02, -0.05, 0.01, 0.99845)),
    90.0,
    90.0,
    60.0,
    40.0,
    120,
    80,
    0.01,
    100.0,
)
RING = tilted(np.array([0.1, 0.2, 0.0]), 1.4)
PATH = [
    Placement(
        "chair",
        Pose(
            (0.8 * np.sin(t), 0.3 * t - 0.5, 0.5 * np.cos(t)),
            (0.0, np.sin(t / 2), 0.0, np.cos(t / 2)),
        ),
        0.7 + 0.2 * t,
    )
    for t in np.linspace(0.0, 3.0, 7)
]


def splats(placement, camera):
    """A frame of a ball of radius 1 about the object's origin: colour by depth, and depth."""
    matrix = as_array(object_to_camera(camera.pose, placement.pose))
    center, radius, ray = matrix[:3, 3], placement.scale, rays(camera)
    a, b = np.sum(ray**2, axis=-1), ray @ center
    discriminant = b * b - a * (center @ center - radius**2)
    depth = np.where(
        discriminant > 0, (b - np.sqrt(np.maximum(discriminant, 0))) / a, np.inf
    ).astype(np.float32)
    color = np.zeros((*depth.shape, 4), np.float32)
    color[np.isfinite(depth)] = 0.2, 0.4, 0.9, 1.0
    return color, depth


def composite(splats_at, ring_at, camera):
    """What is shown of a frame with the ball at one placement, and the ring at another."""
    color, depth = splats(splats_at, camera)
    mesh, mesh_depth = drawn(bound(RING, ring_at, camera), camera)
    return composed(color, depth, camera, Semantics(), mesh, mesh_depth)


def looked_at_from(placement, camera):
    """The same image with the object at rest and of its own size: the camera moves instead."""
    matrix = np.linalg.inv(as_array(object_to_camera(camera.pose, placement.pose)))
    matrix[:3, 3] /= placement.scale
    q = quaternion(matrix[:3, :3])
    return camera._replace(pose=Pose(tuple(matrix[:3, 3]), q))


def quaternion(m):
    w = np.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    return (x / (4 * w), y / (4 * w), z / (4 * w), w)


def different(a, b):
    """How many pixels of two images differ."""
    return int((np.abs(a - b).max(axis=-1) > 1e-3).sum())


@pytest.mark.parametrize("placement", PATH)
def test_a_ring_that_is_bound_moves_turns_and_grows_with_the_splats(placement):
    moved = composite(placement, placement, WIDE)
    at_rest = Placement("chair", IDENTITY)
    still = composite(at_rest, at_rest, looked_at_from(placement, WIDE))
    assert different(moved, still) <= 2, "no more than rounding at edges makes of it"
    seen = {tuple(color) for color in np.unique(moved.reshape(-1, 3), axis=0)}
    assert len(seen) > 50, "ring and ball are both seen"


@pytest.mark.parametrize("placement", PATH)
def test_the_pattern_on_a_ring_turns_with_it(placement):
    ring = bound(RING, placement, WIDE)
    for vector in (ring.axis, ring.first):
        assert np.linalg.norm(vector) == pytest.approx(1.0)
    assert ring.axis @ ring.first == pytest.approx(0.0, abs=1e-12)


def test_with_the_newest_pose_instead_mesh_and_splats_swim():
    """A frame shows where the object was; by now it has been sent elsewhere [OBJ-7]."""
    for of_the_frame, newest in pairwise(PATH):
        aligned = composite(of_the_frame, of_the_frame, WIDE)
        assert different(composite(of_the_frame, newest, WIDE), aligned) > 100
