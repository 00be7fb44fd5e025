"""Poses of camera and scene that are hard on arithmetic, and yet give a view that shows a lot."""

import math
import random
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from splatbus_conformance.cases.valid.poses import (
    NORM_SLACK,
    ROTATIONS,
    Pose,
    SteeredDraw,
    steering,
)
from splatbus_conformance.images.pinhole import rotation_matrix
from splatbus_conformance.oracle import exact, norm, to_double
from splatbus_conformance.oracle.rotations import product


class HardView(NamedTuple):
    """Where camera and scene are, both as on the wire."""

    camera: Pose
    scene: Pose


def hardest(salt: str, farthest: float) -> list[HardView]:
    """One of each kind of rotation, and of the least and the greatest norm."""
    rng = random.Random(salt)
    found = [_stage(turn(rng), rng, farthest) for turn in ROTATIONS]
    for length in (1.0 - NORM_SLACK, 1.0 + NORM_SLACK):
        found.append(_stage([length * part for part in ROTATIONS[0](rng)], rng, farthest))
    return found


def stages(salt: str, farthest: float) -> st.SearchStrategy[HardView]:
    """Cameras up to so far from the origin, turned in every way, before a scene that came along."""

    def stage(turn: Callable[[random.Random], Sequence[float]], steered: SteeredDraw) -> HardView:
        rng = steered.rng(salt)
        return _stage(steered.turned(turn(rng)), rng, farthest)

    return st.builds(stage, st.sampled_from(ROTATIONS), steering())


def staged(camera: Pose, before: Pose) -> HardView:
    """A scene that a camera sees as it would see one at rest from the pose `before`."""
    x, y, z, w = exact(before.rotation)
    scale = norm(camera.rotation) * norm(before.rotation)
    turned = product(exact(camera.rotation), (-x, -y, -z, w))
    rotation = tuple(to_double(number / scale) for number in turned)
    place = np.array(camera.position) - rotation_matrix(rotation) @ np.array(before.position)
    return HardView(camera, Pose(tuple(map(float, place)), rotation))


def turned_about(
    rotation: Sequence[float], axis: Sequence[float], radians: float
) -> tuple[float, ...]:
    """A rotation (x, y, z, w) after a turn about an axis of its own."""
    length = math.hypot(*axis) or 1.0
    sine, cosine = math.sin(radians / 2.0), math.cos(radians / 2.0)
    turn = exact([*(sine * part / length for part in axis), cosine])
    return tuple(map(to_double, product(exact(rotation), turn)))


def _stage(rotation: Sequence[float], rng: random.Random, farthest: float) -> HardView:
    before = Pose(
        (rng.uniform(-1, 1), rng.uniform(-1.2, 0.2), rng.uniform(-2, 0.5)),
        turned_about((0, 0, 0, 1), [rng.gauss(0, 1) for _ in range(3)], rng.uniform(0, 0.25)),
    )
    position = tuple(rng.uniform(-farthest, farthest) for _ in range(3))
    return staged(Pose(position, tuple(rotation)), before)
