"""Objects that move and grow, and the mesh that is bound to one: as one, in every image."""

from __future__ import annotations

import math

import numpy as np
from splatbus_client import FrameLease, Placement, Pose
from splatbus_renderer import scene
from splatbus_viewer.display import rays
from splatbus_viewer.mesh import bound, drawn, tilted
from splatbus_wire.poses import as_array, world_matrix

from tests.pair.known_scene import showing, wrong_pixels
from tests.pair.rig import MOST_SECONDS
from tests.waiting import eventually

RED = scene.default_scene().spheres[0]
STEPS = 60


def placed(number: int) -> Placement:
    angle = number / 9
    half = 0.1 * math.sin(angle / 2)
    turned = (0.0, math.sin(half), 0.0, math.cos(half))
    where = (0.4 * math.sin(angle), 0.02 * angle, 0.3 * math.cos(angle))
    return Placement("default", Pose(where, turned), 1.0 + 0.4 * math.sin(angle / 2))


def in_object(points: np.ndarray, camera: object, placement: Placement) -> np.ndarray:
    """(N, 3) points in camera axes, in the axes and units of an object."""
    to_world = as_array(world_matrix(camera.pose))  # type: ignore[attr-defined]
    turn = as_array(world_matrix(placement.pose))
    world = points @ to_world[:3, :3].T + to_world[:3, 3]
    return (world - turn[:3, 3]) @ turn[:3, :3] / placement.scale


def misplaced(frame: FrameLease, placement: Placement) -> tuple[float, float]:
    """How far sphere and ring are, at worst, from their surfaces in the object's axes."""
    ray = rays(frame.camera)
    reddish = frame.color[..., 0] > 3.0 * np.maximum(frame.color[..., 1], frame.color[..., 2])
    sphere = in_object(ray[reddish] * frame.depth[reddish][:, None], frame.camera, placement)
    off_sphere = np.abs(np.linalg.norm(sphere - RED.center, axis=1) - RED.radius)
    ring = tilted(np.array(RED.center), 1.5 * RED.radius)
    _, depth = drawn(bound(ring, frame.placement(), frame.camera), frame.camera)
    there = np.isfinite(depth)
    mesh = in_object(ray[there] * depth[there][:, None], frame.camera, placement) - ring.center
    across = mesh - (mesh @ ring.axis)[:, None] * ring.axis
    off_ring = np.abs(np.linalg.norm(across, axis=1) - ring.radius)
    assert reddish.sum() > 20
    assert there.sum() > 20
    return float(np.percentile(off_sphere, 95)), float(off_ring.max())


def test_a_mesh_that_is_bound_to_an_object_stays_with_it() -> None:
    other_poses_would_do = 0
    with showing() as (_, tap), tap.session() as session:
        assert eventually(lambda: session.status.message.version), "welcome"
        for number in range(STEPS):
            sent = placed(number)
            session.send_object(sent.pose, scale=sent.scale)
            with session.next_frame(MOST_SECONDS) as frame:
                shown = frame.placement()
                sphere, ring = misplaced(frame, shown)
                assert sphere < 2e-4  # splats and mesh are where the frame says, in one place
                assert ring < 2e-4
                wrong, seen = wrong_pixels(frame, samples=30)
                assert (wrong, seen > 0) == (0, True)
                # Where the object will be three poses later, a mesh would not be with it now.
                other_poses_would_do += misplaced(frame, placed(number + 3))[0] < 2e-4
    assert other_poses_would_do == 0
    tap.assert_conforming()


def test_depth_is_in_world_units_whatever_the_scale() -> None:
    """At half its size and half its distance the scene looks alike, and is half as far."""
    with showing() as (_, tap), tap.session() as session:
        assert eventually(lambda: session.status.message.version), "welcome"
        images = {}
        for scale in (1.0, 0.5):
            session.send_object(Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), scale=scale)
            while scale not in images:
                with session.next_frame(MOST_SECONDS) as frame:
                    if frame.placement().scale == scale:
                        images[scale] = frame.color.copy(), frame.depth.copy()
    (color, depth), (half_color, half_depth) = images[1.0], images[0.5]
    assert np.mean(np.abs(color - half_color) < 1e-3) > 0.98
    near = np.isfinite(depth) & np.isfinite(half_depth)
    assert near.sum() > 100
    assert np.median(np.abs(half_depth[near] / depth[near] - 0.5)) < 1e-5
    tap.assert_conforming()
