"""From a camera's pose to its view matrix, as an array for a renderer [ACC-4, ACC-5, ACC-6]."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from splatbus_conformance import oracle
from splatbus_wire.poses import Pose, as_array, view_matrix, world_matrix
from splatbus_wire.rotations import Matrix3, Quaternion, rotation_matrix

from benchmarks.accuracy import integers, search
from benchmarks.accuracy.rotation import deployed as deployed_rotation
from benchmarks.accuracy.rotation import in_order, in_pairs, textbook
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst
from benchmarks.accuracy.timing import each

TIMED = 1000
HARD = (
    # Where climbs of minutes ended.
    (
        *(272537.426470042, 70729.54335250682, -22345.59187440264),
        *(0.7072903396458428, 0.7105116724151237, -0.07730604940000542, 0.0025501131426139845),
    ),
    (
        *(274085.3448767134, 70570.29587301765, -23348.83573056061),
        *(0.7072903396458428, 0.7105116724151237, -0.07730604940000607, 0.0025501131426196697),
    ),
)
U = float(oracle.U)


def default(pose: Pose) -> Any:
    return as_array(view_matrix(pose))


def rounded_once(pose: Pose) -> Any:
    return as_array(view_matrix(pose), np.float32)


def summed_exactly(pose: Pose) -> Any:
    """The default, but with −Rᵀ·c summed without rounding in between."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(pose.rotation)
    x, y, z = pose.position
    return as_array((
        r00, r10, r20, -math.fsum((r00 * x, r10 * y, r20 * z)),
        r01, r11, r21, -math.fsum((r01 * x, r11 * y, r21 * z)),
        r02, r12, r22, -math.fsum((r02 * x, r12 * y, r22 * z)),
        0.0, 0.0, 0.0, 1.0,
    ))  # fmt: skip


def by(rotation: Callable[[Quaternion], Matrix3], pose: Pose) -> Any:
    """The default, but with another rotation matrix."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation(pose.rotation)
    x, y, z = pose.position
    return as_array((
        r00, r10, r20, -(r00 * x + r10 * y + r20 * z),
        r01, r11, r21, -(r01 * x + r11 * y + r21 * z),
        r02, r12, r22, -(r02 * x + r12 * y + r22 * z),
        0.0, 0.0, 0.0, 1.0,
    ))  # fmt: skip


def rigid_numpy(pose: Pose) -> Any:
    R = np.array(rotation_matrix(pose.rotation)).reshape(3, 3)
    view = np.eye(4)
    view[:3, :3] = R.T
    view[:3, 3] = -R.T @ pose.position
    return view


def general(pose: Pose) -> Any:
    return np.linalg.inv(as_array(world_matrix(pose)))


def general_single(pose: Pose) -> Any:
    return np.linalg.inv(as_array(world_matrix(pose), np.float32))


def rigid_single(pose: Pose) -> Any:
    """Float32 from the rotation matrix on."""
    R = np.array(rotation_matrix(pose.rotation), np.float32).reshape(3, 3)
    view = np.eye(4, dtype=np.float32)
    view[:3, :3] = R.T
    view[:3, 3] = -R.T @ np.array(pose.position, np.float32)
    return view


def deployed(pose: Pose) -> Any:
    """Rotation and position in float32, three general inverses in float64, then float32."""
    world = np.eye(4)
    world[:3, :3] = deployed_rotation(pose.rotation).reshape(3, 3)
    world[:3, 3] = np.array(pose.position, np.float32)
    view = np.linalg.inv(world)
    for _ in range(2):
        view = np.linalg.inv(view)
    return view.astype(np.float32)


def exact(pose: Pose) -> Any:
    rows = oracle.view_matrix(pose.position, pose.rotation)
    return np.array([[float(a) for a in row] for row in rows])


def unpacked(pose: Pose) -> Any:
    """The floor: sixteen numbers that need no arithmetic, as an array."""
    x, y, z = pose.position
    a, b, c, d = pose.rotation
    return as_array((a, b, c, x, b, c, d, y, c, d, a, z, 0.0, 0.0, 0.0, 1.0))


VARIANTS = (
    Variant("default: rigid, plain floats", default, "default"),
    Variant("default, rounded once to float32", rounded_once),
    Variant("rigid, sums without rounding", summed_exactly),
    Variant("rigid, ‖q‖² in order", partial(by, in_order)),
    Variant("rigid, ‖q‖² in pairs", partial(by, in_pairs)),
    Variant("rigid, 1 − s(y²+z²)", partial(by, textbook)),
    Variant("rigid, NumPy", rigid_numpy),
    Variant("rigid, NumPy, float32", rigid_single),
    Variant("general inverse", general),
    Variant("general inverse, float32", general_single),
    Variant("deployed: three general inverses", deployed, "deployed"),
    Variant("rational numbers", exact, slow=True),
)


def pose_of(x: Sequence[float]) -> Pose:
    a, b, c, i, j, k, w = x
    return Pose((a, b, c), (i, j, k, w))


def repaired(x: search.Numbers) -> search.Numbers:
    position = (min(max(a, -1e9), 1e9) for a in x[:3])
    return (*position, *search.unit(x[3:]))


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    pool = [
        (*search.positions(source), *search.quaternions(source)) for _ in range(search.DRAWN)
    ] + [*HARD, *map(tuple, known)]

    def view(x: search.Numbers) -> Any:
        return variant.compute(pose_of(x)).tolist()

    def moved(x: search.Numbers) -> float:
        t = integers.product(integers.rotation(x[3:]), integers.over(x[:3]), transposed=True)
        return integers.norm_error([-row[3] for row in view(x)[:3]], t) / U

    def moved_restated(x: search.Numbers) -> float:
        t = [row[3] for row in view(x)[:3]]
        return oracle.norm_error(t, oracle.view_translation(x[:3], x[3:])) / U

    def centre(x: search.Numbers) -> float:
        rows = view(x)[:3]
        R = integers.over([a for row in rows for a in row[:3]])
        recovered = integers.product(R, integers.over([row[3] for row in rows]), transposed=True)
        difference = integers.differences([-a for a in x[:3]], recovered)
        return math.hypot(*difference) / max(1.0, math.hypot(*x[:3])) / U

    def centre_restated(x: search.Numbers) -> float:
        c = oracle.exact(x[:3])
        difference = [a - b for a, b in zip(oracle.camera_centre(view(x)), c, strict=True)]
        return float(oracle.norm(difference)) / max(1.0, float(oracle.norm(c))) / U

    return [
        search.climb(error, pool, repaired, restated, variant.effort)
        for error, restated in ((moved, moved_restated), (centre, centre_restated))
    ]


def study() -> Study:
    source = random.Random(search.SEED)
    items = [
        pose_of((*search.positions(source), *search.quaternions(source))) for _ in range(TIMED)
    ]
    measures = (
        Measure("Translation −Rᵀ·c, relative to max(1, ‖t‖)", "u", 8.0, "ACC-4"),
        Measure("Camera centre −R·t, relative to max(1, ‖c‖)", "u", 3e-15 / U, "ACC-5"),
    )
    part = Part(
        item="pose",
        items=TIMED,
        floor_title="sixteen numbers of the pose into an array, without arithmetic",
        floor=each(unpacked, items),
        run=lambda compute: each(compute, items),
        worst=worst,
        variants=VARIANTS,
        measures=measures,
    )
    return Study("Camera pose to view matrix", [part])
