"""From the poses of camera and object to the matrix that takes object to camera axes."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rotations import Rows, Vector, apply, multiply, transpose
from splatbus_wire.poses import Pose, as_array, view_matrix, world_matrix
from splatbus_wire.relative import object_to_camera
from splatbus_wire.rotations import rotation_matrix

from benchmarks.accuracy import integers, search
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst
from benchmarks.accuracy.timing import each
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


def by_quaternions(poses: Poses) -> Any:
    """Camera-relative in plain floats; the rotation from the product of the quaternions."""
    (centre, (i, j, k, w)), (position, (a, b, c, d)) = poses
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix((i, j, k, w))
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = rotation_matrix((
        w * a - i * d - j * c + k * b,
        w * b + i * c - j * d - k * a,
        w * c - i * b + j * a - k * d,
        w * d + i * a + j * b + k * c,
    ))  # fmt: skip
    x, y, z = (p - q for p, q in zip(position, centre, strict=True))
    return as_array((
        m00, m01, m02, r00 * x + r10 * y + r20 * z,
        m10, m11, m12, r01 * x + r11 * y + r21 * z,
        m20, m21, m22, r02 * x + r12 * y + r22 * z,
        0.0, 0.0, 0.0, 1.0,
    ))  # fmt: skip


def rigid(poses: Poses) -> Any:
    """View matrix times object matrix."""
    return as_array(view_matrix(poses.camera)) @ as_array(world_matrix(poses.points))


def general(poses: Poses) -> Any:
    """General inverse of the camera's matrix, times the object's."""
    return np.linalg.inv(as_array(world_matrix(poses.camera))) @ as_array(
        world_matrix(poses.points)
    )


def relative_single(poses: Poses) -> Any:
    """Subtracted in float64, everything after in float32."""
    camera, points = poses
    moved = as_array(world_matrix(points))
    moved[:3, 3] -= camera.position
    turned = np.eye(4, dtype=np.float32)
    turned[:3, :3] = np.array(rotation_matrix(camera.rotation)).reshape(3, 3).T
    return turned @ moved.astype(np.float32)


def single(poses: Poses) -> Any:
    """The rigid inverse in float64, cast, times the object's matrix in float32."""
    return as_array(view_matrix(poses.camera), np.float32) @ as_array(
        world_matrix(poses.points), np.float32
    )


def deployed(poses: Poses) -> Any:
    """What the deployed matrices amount to: it moves all Gaussians by the object's."""
    return deployed_view(poses.camera) @ as_array(world_matrix(poses.points), np.float32)


def exact(poses: Poses) -> Any:
    R, t = composed(tuple(a for pose in poses for vector in pose for a in vector))
    rows = [[float(a) for a in row] for row in R]
    upper = [[*row, float(a)] for row, a in zip(rows, t, strict=True)]
    return np.array([*upper, [0.0, 0.0, 0.0, 1.0]])


def unpacked(poses: Poses) -> Any:
    """The floor: sixteen numbers of both poses, as an array."""
    ((x, y, z), (a, b, c, d)), ((p, q, r), (e, f, g, h)) = poses
    return as_array((a, b, c, x, d, e, f, y, g, h, p, z, q, r, 0.0, 1.0))


VARIANTS = (
    Variant("default: camera-relative, plain floats", default, "default"),
    Variant("camera-relative, NumPy", view_times_moved),
    Variant("camera-relative, quaternion product", by_quaternions),
    Variant("camera-relative, then float32", relative_single),
    Variant("view · object", rigid),
    Variant("general inverse · object", general),
    Variant("view · object, float32", single),
    Variant("deployed: three inverses · object", deployed, "deployed"),
    Variant("rational numbers", exact, slow=True),
)


def poses_of(x: Sequence[float]) -> Poses:
    return Poses(pose_of(x[:7]), pose_of(x[7:]))


def composed(x: search.Numbers) -> tuple[Rows, Vector]:
    to_camera = transpose(oracle.rotation_matrix(x[3:7]))
    between = [a - b for a, b in zip(map(Fraction, x[7:10]), map(Fraction, x[:3]), strict=True)]
    return multiply(to_camera, oracle.rotation_matrix(x[10:])), apply(to_camera, between)


def drawn(source: random.Random) -> search.Numbers:
    place = search.positions(source, 0, FARTHEST)
    near = (a + 10.0 ** source.uniform(0, 1) * source.uniform(-1, 1) for a in place)
    return (*near, *search.quaternions(source), *place, *search.quaternions(source))


def repaired(x: search.Numbers) -> search.Numbers:
    """The camera stays within 10 units of the object."""
    place = tuple(min(max(a, -(10.0**FARTHEST)), 10.0**FARTHEST) for a in x[7:10])
    near = (p + min(max(c - p, -10.0), 10.0) for c, p in zip(x[:3], place, strict=True))
    return (*near, *search.unit(x[3:7]), *place, *search.unit(x[10:]))


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    pool = [drawn(source) for _ in range(search.DRAWN)] + [tuple(x) for x in known]

    def computed(x: search.Numbers) -> tuple[list[float], list[float]]:
        rows = variant.compute(poses_of(x)).tolist()[:3]
        return [a for row in rows for a in row[:3]], [row[3] for row in rows]

    def moved(x: search.Numbers) -> float:
        both, one = integers.over((*x[7:10], *x[:3]))
        between = integers.Over(tuple(p - c for p, c in zip(both[:3], both[3:], strict=True)), one)
        t = integers.product(integers.rotation(x[3:7]), between, transposed=True)
        return integers.norm_error(computed(x)[1], t) / U

    def moved_restated(x: search.Numbers) -> float:
        return oracle.norm_error(computed(x)[1], composed(x)[1]) / U

    def turned(x: search.Numbers) -> float:
        R = integers.product(integers.rotation(x[3:7]), integers.rotation(x[10:]), transposed=True)
        return integers.entry_error(computed(x)[0], R) / U

    def turned_restated(x: search.Numbers) -> float:
        return oracle.error_in_u(computed(x)[0], sum(composed(x)[0], ()))

    return [
        search.climb(error, pool, repaired, restated, variant.effort)
        for error, restated in ((moved, moved_restated), (turned, turned_restated))
    ]


def study() -> Study:
    source = random.Random(search.SEED)
    items = [poses_of(drawn(source)) for _ in range(TIMED)]
    measures = (
        Measure("Translation, relative to max(1, ‖t‖)", "u"),
        Measure("An entry of the rotation", "u"),
    )
    part = Part(
        item="pair of poses",
        items=TIMED,
        floor_title="sixteen numbers of both poses into an array, without arithmetic",
        floor=each(unpacked, items),
        run=lambda compute: each(compute, items),
        worst=worst,
        variants=VARIANTS,
        measures=measures,
    )
    return Study("Camera over object: one matrix from two poses", [part])
