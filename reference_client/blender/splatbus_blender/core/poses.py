"""Where things are: from Blender's numbers to poses on the wire, in double precision [CNV-6].

Blender keeps location, rotation and scale of an object in single precision, and multiplies them to
a matrix that is rounded once more. What is sent comes from the former where they say the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from splatbus_wire.conventions import BLENDER_CAMERA, BLENDER_OBJECT
from splatbus_wire.poses import Pose, Vector
from splatbus_wire.rotations import Matrix3, Quaternion, quaternion_from_matrix, rotation_matrix

Rows = Sequence[Sequence[float]]
"""A 4×4 matrix by its rows, as Blender has them: [R·S | t]."""

_AGREES = 16 * 2.0**-23
"""What single precision does to an entry of a matrix that is a product of a few."""
_SAME_SCALE = 1e-5


class Placed(NamedTuple):
    """A thing in Blender's world.

    Attributes:
        position: in Blender's units.
        rotation: unit quaternion (x, y, z, w) from its axes to the world's.
        scale: along its own axes, each positive.
    """

    position: Vector
    rotation: Quaternion
    scale: Vector = (1.0, 1.0, 1.0)


def camera_pose(placed: Placed, unit: float = 1.0) -> Pose:
    """Return a camera's pose on the wire; its scale is of no account, as in Blender.

    Args:
        placed: a camera, which looks along its own −z.
        unit: Blender's units to one of the splats' scene.
    """
    return BLENDER_CAMERA.to_wire(_in_scene_units(placed, unit))


def object_pose(placed: Placed, unit: float = 1.0) -> tuple[Pose, float]:
    """Return an object's pose on the wire, and its scale [OBJ-1].

    Raises:
        ValueError: its scale is not the same along all axes.
    """
    least, most = min(placed.scale), max(placed.scale)
    if most - least > _SAME_SCALE * most:
        raise ValueError(f"its scale has to be the same along all axes, and is {placed.scale}")
    scale = most if least == most else sum(placed.scale) / 3
    return BLENDER_OBJECT.to_wire(_in_scene_units(placed, unit)), scale


def from_matrix(rows: Rows) -> Placed:
    """Return what a matrix says.

    Raises:
        ValueError: it mirrors, leaves an axis without length, or axes not at right angles.
    """
    columns = [tuple(row[i] for row in rows[:3]) for i in range(3)]
    scale = tuple(math.hypot(*column) for column in columns)
    if not all(length > 0 for length in scale):
        raise ValueError("it has no size along one of its axes")
    x, y, z = ([each / length for each in column] for column, length in zip(columns, scale))
    turned: Matrix3 = (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])
    position = (rows[0][3], rows[1][3], rows[2][3])
    return Placed(position, quaternion_from_matrix(turned), (scale[0], scale[1], scale[2]))


def agree(placed: Placed, rows: Rows, reach: float = 0.0) -> bool:
    """Whether a matrix says the same but for the rounding of single precision.

    Args:
        placed: what it is compared with.
        rows: the matrix.
        reach: the largest number that its position was computed from, if larger than those in it.
    """
    r = rotation_matrix(placed.rotation)
    at = max(reach, *map(abs, placed.position))
    return all(
        abs(r[3 * i + j] * placed.scale[j] - rows[i][j]) <= _AGREES * abs(placed.scale[j])
        for i in range(3)
        for j in range(3)
    ) and all(abs(placed.position[i] - rows[i][3]) <= _AGREES * at for i in range(3))


def orbiting(centre: Vector, rotation: Quaternion, distance: float) -> Placed:
    """Return the eye of a viewport that looks at `centre` from so far, along its own −z."""
    q = unit_quaternion(rotation)
    r = rotation_matrix(q)
    x, y, z = (centre[i] + distance * r[3 * i + 2] for i in range(3))
    return Placed((x, y, z), q)


def unit_quaternion(q: Quaternion) -> Quaternion:
    """Return it with the norm 1; Blender turns by one that has another as if it had not.

    Raises:
        ValueError: it is zero.
    """
    norm = math.hypot(*q)
    if not norm > 0:
        raise ValueError("its rotation is a quaternion of zeros")
    x, y, z, w = q
    return x / norm, y / norm, z / norm, w / norm


def from_axis_angle(angle: float, axis: Vector) -> Quaternion:
    """Return the rotation about an axis of any length; none about one without length."""
    length = math.hypot(*axis)
    if length == 0:
        return 0.0, 0.0, 0.0, 1.0
    s = math.sin(angle / 2) / length
    return s * axis[0], s * axis[1], s * axis[2], math.cos(angle / 2)


def from_euler(angles: Vector, order: str) -> Quaternion:
    """Return the rotation by radians about x, y and z; `order` "XYZ" turns about x first."""
    q = [0.0, 0.0, 0.0, 1.0]
    for name in order:
        i = "XYZ".index(name)
        j, k = (i + 1) % 3, (i + 2) % 3
        s, c = math.sin(angles[i] / 2), math.cos(angles[i] / 2)
        about, one, other, w = q[i], q[j], q[k], q[3]
        q[i], q[j], q[k] = c * about + s * w, c * one - s * other, c * other + s * one
        q[3] = c * w - s * about
    return unit_quaternion((q[0], q[1], q[2], q[3]))


def _in_scene_units(placed: Placed, unit: float) -> Pose:
    x, y, z = placed.position
    return Pose((x / unit, y / unit, z / unit), placed.rotation)
