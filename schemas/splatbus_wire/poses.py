"""Poses, and the matrices that a renderer wants of them.

A 4×4 matrix is a flat tuple of sixteen floats in row-major order; `as_array` makes it an array.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from splatbus_wire.rotations import Quaternion, rotation_matrix

Vector = tuple[float, float, float]
Matrix4 = tuple[
    float, float, float, float,
    float, float, float, float,
    float, float, float, float,
    float, float, float, float,
]  # fmt: skip


class Pose(NamedTuple):
    """Camera-to-world or object-to-world, in the axes of the wire [CNV-1, CNV-2].

    Attributes:
        position: the camera's centre, or the object's origin, in world axes and scene units.
        rotation: quaternion (x, y, z, w) that turns camera (object) axes into world axes.
    """

    position: Vector
    rotation: Quaternion


IDENTITY = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def world_matrix(pose: Pose) -> Matrix4:
    """Return [R | c], which takes camera or object axes to world axes."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(pose.rotation)
    x, y, z = pose.position
    return (
        r00, r01, r02, x,
        r10, r11, r12, y,
        r20, r21, r22, z,
        0.0, 0.0, 0.0, 1.0,
    )  # fmt: skip


def view_matrix(pose: Pose) -> Matrix4:
    """Return [Rᵀ | −Rᵀ·c], which takes world axes to camera axes [ACC-2, ACC-3, ACC-4]."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(pose.rotation)
    x, y, z = pose.position
    return (
        r00, r10, r20, -(r00 * x + r10 * y + r20 * z),
        r01, r11, r21, -(r01 * x + r11 * y + r21 * z),
        r02, r12, r22, -(r02 * x + r12 * y + r22 * z),
        0.0, 0.0, 0.0, 1.0,
    )  # fmt: skip


def camera_centre(view: Matrix4) -> Vector:
    """Return the camera's centre in world axes, −R·t, from its view matrix [ACC-5]."""
    v00, v01, v02, t0, v10, v11, v12, t1, v20, v21, v22, t2 = view[:12]
    return (
        -(v00 * t0 + v10 * t1 + v20 * t2),
        -(v01 * t0 + v11 * t1 + v21 * t2),
        -(v02 * t0 + v12 * t1 + v22 * t2),
    )


def as_array(matrix: Matrix4, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Return the matrix as a (4, 4) array; in single precision each entry is rounded once [ACC-6].

    Args:
        matrix: flat, row-major.
        dtype: float64 or float32.
    """
    return np.array(matrix, dtype).reshape(4, 4)
