"""Cameras that a hand moves: about something, through the air, on foot.

Axes are those of the wire: x right, y down, z forward, for the world as for the camera [CNV-1].
Functions from eyes to eyes; an eye keeps the pose that it was given until it is moved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.poses import Pose, Vector
from splatbus_wire.rotations import quaternion_from_matrix, rotation_matrix

KINDS = ("orbit", "fly", "first-person")
STEEPEST = math.radians(89)
"""Of cameras that know where up is."""
NEAREST = 1e-3
Float64Array = NDArray[np.float64]


class Eye(NamedTuple):
    """A camera, and how far before it is what it moves about, in scene units."""

    pose: Pose
    distance: float = 3.0

    @property
    def pivot(self) -> Vector:
        """What it moves about, in world axes."""
        return _vector(self.pose.position + self.distance * _matrix(self.pose)[:, 2])


def turned(eye: Eye, kind: str, right: float, down: float) -> Eye:
    """Return the eye turned by radians: about its pivot in orbit, else where it stands.

    In orbit what is seen follows the hand. On foot the head stays upright.
    """
    R = _matrix(eye.pose)
    if kind == "first-person":
        forward = R[:, 2]
        turn = math.atan2(forward[0], forward[2]) + right
        tilt = _tilt(forward) - down
        R = _about_y(turn) @ _about_x(min(max(tilt, -STEEPEST), STEEPEST))
        return eye._replace(pose=_pose(eye.pose.position, R))
    if kind == "fly":
        R = R @ _about_y(right) @ _about_x(-down)
        return eye._replace(pose=_pose(eye.pose.position, R))
    tilt = _tilt(R[:, 2])
    steepest = max(STEEPEST, abs(tilt))
    R = _about_y(right) @ R @ _about_x(min(max(tilt - down, -steepest), steepest) - tilt)
    return eye._replace(pose=_pose(eye.pivot - eye.distance * R[:, 2], R))


def moved(eye: Eye, kind: str, right: float, down: float, forward: float) -> Eye:
    """Return the eye moved by scene units, and its pivot with it.

    On foot it goes along the ground, and down is the world's; else along its own axes.
    """
    R = _matrix(eye.pose)
    if kind == "first-person":
        R = _about_y(math.atan2(R[0, 2], R[2, 2]))
    position = eye.pose.position + R @ (right, down, forward)
    return eye._replace(pose=eye.pose._replace(position=_vector(position)))


def rolled(eye: Eye, angle: float) -> Eye:
    """Return the eye rolled clockwise, as it sees, by radians."""
    R = _matrix(eye.pose) @ _about_z(angle)
    return eye._replace(pose=_pose(eye.pose.position, R))


def nearer(eye: Eye, factor: float) -> Eye:
    """Return the eye so many times as far from its pivot, which stays where it is."""
    distance = max(factor * eye.distance, NEAREST)
    position = eye.pivot - distance * _matrix(eye.pose)[:, 2]
    return Eye(eye.pose._replace(position=_vector(position)), distance)


def _tilt(forward: Float64Array) -> float:
    return math.asin(min(max(-float(forward[1]), -1.0), 1.0))


def _matrix(pose: Pose) -> Float64Array:
    return np.array(rotation_matrix(pose.rotation)).reshape(3, 3)


def _pose(position: Float64Array | Vector, R: Float64Array) -> Pose:
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = R.ravel().tolist()
    rotation = quaternion_from_matrix((r00, r01, r02, r10, r11, r12, r20, r21, r22))
    return Pose(_vector(position), rotation)


def _vector(numbers: Float64Array | Vector) -> Vector:
    x, y, z = map(float, numbers)
    return x, y, z


def _about_x(angle: float) -> Float64Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_y(angle: float) -> Float64Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _about_z(angle: float) -> Float64Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
