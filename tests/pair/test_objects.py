"""What a viewer draws beside the images of an object that is moved."""

from __future__ import annotations

import math

import numpy as np
from splatbus_client import FrameLease, Placement, Pose
from splatbus_renderer import scene
from splatbus_viewer.display import rays
from splatbus_viewer.mesh import bound, drawn, tilted
from splatbus_wire.poses import as_array, world_matrix

from tests.pair.known_scene import is_right, showing
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


def misplaced(frame: FrameLease, placement: Placement) -> float:
    """How far a ring that is bound to the object is, at worst, from that of the object there."""
    ring = tilted(np.array(RED.center), 1.5 * RED.radius)
    _, depth = drawn(bound(ring, frame.placement(), frame.camera), frame.camera)
    there = np.isfinite(depth)
    assert there.sum() > 20
    points = rays(frame.camera)[there] * depth[there][:, None]
    to_world, turn = (as_array(world_matrix(of.pose)) for of in (frame.camera, placement))
    world = points @ to_world[:3, :3].T + to_world[:3, 3]
    mesh = (world - turn[:3, 3]) @ turn[:3, :3] / placement.scale - ring.center
    across = mesh - (mesh @ ring.axis)[:, None] * ring.axis
    return float(np.abs(np.linalg.norm(across, axis=1) - ring.radius).max())


def test_a_mesh_that_is_bound_to_an_object_stays_with_it() -> None:
    """Where a frame says, as its splats are: at the same place."""
    with showing() as (_, tap), tap.session() as session:
        assert eventually(lambda: session.status.message.version), "welcome"
        for number in range(STEPS):
            sent = placed(number)
            session.send_object(sent.pose, scale=sent.scale)
            with session.next_frame(MOST_SECONDS) as frame:
                assert is_right(frame)
                assert misplaced(frame, frame.placement()) < 2e-4
                # Where the object will be three poses later, a mesh would not be with it now.
                assert misplaced(frame, placed(number + 3)) > 2e-4
    tap.assert_conforming()
