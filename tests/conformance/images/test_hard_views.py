"""Poses of camera and scene that belong together."""

import math

import numpy as np
from splatbus_conformance.cases.drawing import draw
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.hard_views import hardest, staged, stages
from splatbus_conformance.images.pinhole import rigid

LOCAL = Pose((0.3, -0.5, -1.0), (0.05, -0.1, 0.02, 0.99))


def test_a_staged_scene_is_seen_as_from_the_pose_before_it() -> None:
    for norm in (0.991, 1.0, 1.009):
        rotation = tuple(norm * part for part in (0.5, -0.5, 0.5, 0.5))
        stage = staged(Pose((10.0, -200.0, 3000.0), rotation), LOCAL)
        camera, scene, local = rigid(*stage.camera), rigid(*stage.scene), rigid(*LOCAL)
        assert np.allclose(scene.rotation.T @ camera.rotation, local.rotation, atol=1e-12)
        assert np.allclose(scene.sees(camera.position), local.position, atol=1e-9)


def test_every_stage_is_a_pair_of_valid_poses_within_reach() -> None:
    norms = set()
    for camera, scene in [*hardest("test", 100.0), *draw(stages("test", 100.0), 200, 1)]:
        norms.add(round(math.hypot(*camera.rotation), 4))
        assert abs(math.hypot(*camera.rotation) - 1.0) <= 0.01
        assert abs(math.hypot(*scene.rotation) - 1.0) <= 1e-12
        assert max(map(abs, camera.position)) <= 100.0
        assert np.linalg.norm(rigid(*scene).sees(np.array(camera.position))) < 3.0
    assert len(norms) > 5, "quaternions of many norms"
    assert min(norms) < 0.991
    assert max(norms) > 1.009
