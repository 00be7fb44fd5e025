"""From the poses of camera and object to the matrix that takes object to camera axes."""

from __future__ import annotations

import random
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from splatbus_wire.poses import Pose, as_array, view_matrix, world_matrix
from splatbus_wire.relative import object_to_camera

from benchmarks.accuracy import integers, search
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, each
from benchmarks.accuracy.view import U, pose_of
from benchmarks.accuracy.view import deployed as deployed_view

TIMED = 500
FARTHEST = 6
"""The scene lies up to 10⁶ units from the origin, and the camera 1 to 10 units from it."""


class Poses(NamedTuple):
    """Camera-to-world, and object-to-world."""

    camera: Pose
    points: Pose


def default(poses: Poses) -> Any:
    return as_array(object_to_camera(*poses))


def view_times_moved(poses: Poses) -> Any:
    """Camera-relative: [Rᵀ | 0] times the object's matrix, its position less the camera's."""
    turned = as_array(view_matrix(poses.camera))
    turned[:3, 3] = 0.0
    moved = as_array(world_matrix(poses.points))
    moved[:3, 3] -= poses.camera.position
    return turned @ moved


def rigid(poses: Poses) -> Any:
    """View matrix times object matrix."""
    return as_array(view_matrix(poses.camera)) @ as_array(world_matrix(poses.points))


def general(poses: Poses) -> Any:
    """General inverse of the camera's matrix, times the object's."""
    return np.linalg.inv(as_array(world_matrix(poses.camera))) @ as_array(
        world_matrix(poses.points)
    )


def single(poses: Poses) -> Any:
    """The rigid inverse in float64, cast, times the object's matrix in float32."""
    return as_array(view_matrix(poses.camera), np.float32) @ as_array(
        world_matrix(poses.points), np.float32
    )


def deployed(poses: Poses) -> Any:
    """What the deployed matrices amount to: it moves all Gaussians by the object's."""
    return deployed_view(poses.camera) @ as_array(world_matrix(poses.points), np.float32)


def unpacked(poses: Poses) -> Any:
    """The floor: sixteen numbers of both poses, as an array."""
    ((x, y, z), (a, b, c, d)), ((p, q, r), (e, f, g, h)) = poses
    return as_array((a, b, c, x, d, e, f, y, g, h, p, z, q, r, 0.0, 1.0))


VARIANTS = (
    Variant("default: camera-relative, plain floats", default, "default"),
    Variant("camera-relative, NumPy", view_times_moved),
    Variant("view · object", rigid),
    Variant("general inverse · object", general),
    Variant("view · object, float32", single),
    Variant("deployed: three inverses · object", deployed, "deployed"),
)


def poses_of(x: Sequence[float]) -> Poses:
    return Poses(pose_of(x[:7]), pose_of(x[7:]))


def drawn(source: random.Random) -> search.Numbers:
    place = search.positions(source, 0, FARTHEST)
    near = (a + 10.0 ** source.uniform(0, 1) * source.uniform(-1, 1) for a in place)
    return (*near, *search.quaternions(source), *place, *search.quaternions(source))


def repaired(x: search.Numbers) -> search.Numbers:
    """The camera stays within 10 units of the object."""
    place = tuple(min(max(a, -(10.0**FARTHEST)), 10.0**FARTHEST) for a in x[7:10])
    near = (p + min(max(c - p, -10.0), 10.0) for c, p in zip(x[:3], place, strict=True))
    return (*near, *search.unit(x[3:7]), *place, *search.unit(x[10:]))


def moved(compute: Compute, x: search.Numbers) -> float:
    both, one = integers.over((*x[7:10], *x[:3]))
    between = integers.Over(tuple(p - c for p, c in zip(both[:3], both[3:], strict=True)), one)
    t = integers.product(integers.rotation(x[3:7]), between, transposed=True)
    return integers.norm_error(compute(poses_of(x))[:3, 3].tolist(), t) / U


def turned(compute: Compute, x: search.Numbers) -> float:
    R = integers.product(integers.rotation(x[3:7]), integers.rotation(x[10:]), transposed=True)
    return integers.entry_error(search.floats(compute(poses_of(x))[:3, :3]), R) / U


def study() -> Study:
    source = random.Random(search.SEED)
    items = [poses_of(drawn(source)) for _ in range(TIMED)]
    return Study(
        title="Camera over object: one matrix from two poses",
        item="pair of poses",
        items=TIMED,
        floor_title="sixteen numbers of both poses into an array, without arithmetic",
        floor=each(items, unpacked),
        run=partial(each, items),
        variants=VARIANTS,
        measures=(
            Measure("Translation, relative to max(1, ‖t‖)", "u"),
            Measure("An entry of the rotation", "u"),
        ),
        worst=search.climbing((moved, turned), drawn, repaired),
    )
