"""Lenses, poses, times, sizes and objects: every image is what its own frame says, to the pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from splatbus_client import FrameLease, Intrinsics, Placement, Pose
from splatbus_renderer import scene
from splatbus_viewer.display import rays
from splatbus_viewer.mesh import bound, drawn, tilted
from splatbus_viewer.poses import look_at
from splatbus_wire.poses import as_array, world_matrix

from tests.pair.known_scene import is_right, showing
from tests.pair.rig import MOST_SECONDS
from tests.waiting import eventually

RED = scene.default_scene().spheres[0]
STEPS = 60
LENSES = [
    Intrinsics(800.0, 800.0, 960.0, 540.0, 1920, 1080, 0.01, 100.0),
    Intrinsics(90.0, 120.0, 40.0, 30.0, 96, 54, 0.5, 6.0),
    Intrinsics(300.0, 310.0, 100.0, 300.0, 854, 480, 0.01, 4.5),
]


def placed(number: int) -> Placement:
    angle = number / 9
    half = 0.1 * math.sin(angle / 2)
    turned = (0.0, math.sin(half), 0.0, math.cos(half))
    where = (0.4 * math.sin(angle), 0.02 * angle, 0.3 * math.cos(angle))
    return Placement("default", Pose(where, turned), 1.0 + 0.4 * math.sin(angle / 2))


@pytest.mark.parametrize("degrees", [0.0, -45.0])
def test_every_frame_is_what_it_says_itself(degrees: float) -> None:
    """[CAM-2, CAM-5, OBJ-5 to OBJ-7, TIM-3, VPT-5]"""
    with showing(degrees=degrees) as (_, tap), tap.session() as session:
        assert eventually(lambda: session.status.message.version), "welcome"
        for number in range(STEPS):
            angle = number / 10
            eye = (2 * math.sin(angle), -0.5 - angle / 10, 1 - math.cos(angle))
            if number == STEPS // 2:
                assert session.set_viewport(64, 36, MOST_SECONDS) == (64, 36)
            if number % 3 == 0:
                session.send_time(0.3 * number)
                session.send_object(placed(number).pose, "ball", 1.0 + number / 50)
            session.send_object(placed(number).pose, scale=placed(number).scale)
            lens = LENSES[number % 3] if number % 5 else None
            session.send_camera(look_at(eye, (0.0, 0.0, 4.0)), intrinsics=lens, tag=str(number))
            while True:
                with session.next_frame(MOST_SECONDS) as frame:
                    assert is_right(frame, degrees)
                    if frame.camera.tag == str(number):
                        break
    tap.assert_conforming()


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
    with showing() as (_, tap), tap.session() as session:
        assert eventually(lambda: session.status.message.version), "welcome"
        for number in range(STEPS):
            sent = placed(number)
            session.send_object(sent.pose, scale=sent.scale)
            with session.next_frame(MOST_SECONDS) as frame:
                sphere, ring = misplaced(frame, frame.placement())
                assert sphere < 2e-4  # splats and mesh are where the frame says, in one place
                assert ring < 2e-4
                # Where the object will be three poses later, a mesh would not be with it now.
                assert misplaced(frame, placed(number + 3))[0] > 2e-4
    tap.assert_conforming()
