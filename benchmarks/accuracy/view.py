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
from benchmarks.accuracy.rotation import in_order, textbook
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, each

TIMED = 1000
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


def general(pose: Pose) -> Any:
    return np.linalg.inv(as_array(world_matrix(pose)))


def deployed(pose: Pose) -> Any:
    """Rotation and position in float32, three general inverses in float64, then float32."""
    world = np.eye(4)
    world[:3, :3] = deployed_rotation(pose.rotation).reshape(3, 3)
    world[:3, 3] = np.array(pose.position, np.float32)
    view = np.linalg.inv(world)
    for _ in range(2):
        view = np.linalg.inv(view)
    return view.astype(np.float32)


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
    Variant("rigid, 1 − s(y²+z²)", partial(by, textbook)),
    Variant("general inverse", general),
    Variant("deployed: three general inverses", deployed, "deployed"),
)


def pose_of(x: Sequence[float]) -> Pose:
    a, b, c, i, j, k, w = x
    return Pose((a, b, c), (i, j, k, w))


def drawn(source: random.Random) -> search.Numbers:
    return (*search.positions(source), *search.quaternions(source))


def repaired(x: search.Numbers) -> search.Numbers:
    position = (min(max(a, -1e9), 1e9) for a in x[:3])
    return (*position, *search.unit(x[3:]))


def moved(compute: Compute, x: search.Numbers) -> float:
    t = integers.product(integers.rotation(x[3:]), integers.over(x[:3]), transposed=True)
    rows = compute(pose_of(x)).tolist()
    return integers.norm_error([-row[3] for row in rows[:3]], t) / U


def centre(compute: Compute, x: search.Numbers) -> float:
    rows = compute(pose_of(x)).tolist()[:3]
    R = integers.over([a for row in rows for a in row[:3]])
    recovered = integers.product(R, integers.over([row[3] for row in rows]), transposed=True)
    difference = integers.differences([-a for a in x[:3]], recovered)
    return math.hypot(*difference) / max(1.0, math.hypot(*x[:3])) / U


def study() -> Study:
    source = random.Random(search.SEED)
    items = [pose_of(drawn(source)) for _ in range(TIMED)]
    return Study(
        title="Camera pose to view matrix",
        item="pose",
        items=TIMED,
        floor_title="sixteen numbers of the pose into an array, without arithmetic",
        floor=each(items, unpacked),
        run=partial(each, items),
        variants=VARIANTS,
        measures=(
            Measure("Translation −Rᵀ·c, relative to max(1, ‖t‖)", "u", 8.0, "ACC-4"),
            Measure("Camera centre −R·t, relative to max(1, ‖c‖)", "u", 3e-15 / U, "ACC-5"),
        ),
        worst=search.climbing((moved, centre), drawn, repaired),
    )
