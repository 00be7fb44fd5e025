"""From the axes of the wire to those of an engine and back: the table of section 7.2.

Positions and rotation matrices follow from a change of world axes B and a change of camera axes D,
exactly, because both are signed permutations [ACC-7]; quaternions are written out as in the table.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

from splatbus_wire.poses import Pose, Vector
from splatbus_wire.rotations import Matrix3, Quaternion

HALF_SQRT = sqrt(0.5)


@dataclass(frozen=True)
class Engine:
    """How one engine sees the world and the camera.

    Attributes:
        world: B, the change of world axes, p' = scale·B·p; flat row-major 3×3.
        camera: D, the change of the camera's (object's) own axes, R' = B·R·Dᵀ; flat row-major 3×3.
        scale: the engine's units per scene unit.
        rotation_from_wire: (x, y, z, w) on the wire to (x, y, z, w) in the engine.
        rotation_to_wire: the inverse of `rotation_from_wire`.
    """

    world: Matrix3
    camera: Matrix3
    scale: float
    rotation_from_wire: Callable[[Quaternion], Quaternion]
    rotation_to_wire: Callable[[Quaternion], Quaternion]

    def from_wire(self, pose: Pose) -> Pose:
        """Return the engine's pose for one of the wire."""
        return Pose(self.position_from_wire(pose.position), self.rotation_from_wire(pose.rotation))

    def to_wire(self, pose: Pose) -> Pose:
        """Return the wire's pose for one of the engine."""
        return Pose(self.position_to_wire(pose.position), self.rotation_to_wire(pose.rotation))

    def position_from_wire(self, position: Vector) -> Vector:
        """Return scale·B·p in the engine's units, within half an ULP; exact where scale is 1."""
        x, y, z = _apply(self.world, position)
        return self.scale * x, self.scale * y, self.scale * z

    def position_to_wire(self, position: Vector) -> Vector:
        """Return Bᵀ·p'/scale in scene units, within half an ULP; exact where scale is 1."""
        x, y, z = _apply(_transpose(self.world), position)
        return x / self.scale, y / self.scale, z / self.scale

    def matrix_from_wire(self, R: Matrix3) -> Matrix3:
        """Return R' = B·R·Dᵀ, exactly."""
        return _product(_product(self.world, R), _transpose(self.camera))

    def matrix_to_wire(self, R: Matrix3) -> Matrix3:
        """Return R = Bᵀ·R'·D, exactly."""
        return _product(_product(_transpose(self.world), R), self.camera)


def _apply(M: Matrix3, v: Vector) -> Vector:
    a, b, c, d, e, f, g, h, i = M
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def _transpose(M: Matrix3) -> Matrix3:
    a, b, c, d, e, f, g, h, i = M
    return a, d, g, b, e, h, c, f, i


def _product(M: Matrix3, N: Matrix3) -> Matrix3:
    a, b, c, d, e, f, g, h, i = _transpose(N)
    return _transpose((*_apply(M, (a, b, c)), *_apply(M, (d, e, f)), *_apply(M, (g, h, i))))


def _unity(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return -x, y, -z, w


def _unreal_from_wire(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return -z, -x, y, w


def _unreal_to_wire(q: Quaternion) -> Quaternion:
    a, b, c, w = q
    return -b, c, -a, w


def _blender_object_from_wire(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return x, z, -y, w


def _blender_object_to_wire(q: Quaternion) -> Quaternion:
    a, b, c, w = q
    return a, -c, b, w


def _blender_camera_from_wire(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return (
        HALF_SQRT * (x + w),
        HALF_SQRT * (z - y),
        -HALF_SQRT * (y + z),
        HALF_SQRT * (w - x),
    )


def _blender_camera_to_wire(q: Quaternion) -> Quaternion:
    a, b, c, w = q
    return (
        HALF_SQRT * (a - w),
        -HALF_SQRT * (b + c),
        HALF_SQRT * (b - c),
        HALF_SQRT * (a + w),
    )


def _opengl(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return x, -y, -z, w


def _opengl_camera_from_wire(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return w, z, -y, -x


def _opengl_camera_to_wire(q: Quaternion) -> Quaternion:
    a, b, c, w = q
    return -w, -c, b, a


_SAME: Matrix3 = (1, 0, 0, 0, 1, 0, 0, 0, 1)
_Y_FLIPPED: Matrix3 = (1, 0, 0, 0, -1, 0, 0, 0, 1)
_Y_AND_Z_FLIPPED: Matrix3 = (1, 0, 0, 0, -1, 0, 0, 0, -1)
_FORWARD_RIGHT_UP: Matrix3 = (0, 0, 1, 1, 0, 0, 0, -1, 0)
_RIGHT_FORWARD_UP: Matrix3 = (1, 0, 0, 0, 0, 1, 0, -1, 0)

UNITY = Engine(_Y_FLIPPED, _Y_FLIPPED, 1.0, _unity, _unity)
"""Unity, camera and object [CNV-4]."""

UNREAL = Engine(_FORWARD_RIGHT_UP, _FORWARD_RIGHT_UP, 100.0, _unreal_from_wire, _unreal_to_wire)
"""Unreal, camera and object, in centimetres where a scene unit is a metre [CNV-5]."""

BLENDER_OBJECT = Engine(
    _RIGHT_FORWARD_UP,
    _RIGHT_FORWARD_UP,
    1.0,
    _blender_object_from_wire,
    _blender_object_to_wire,
)
"""An object in Blender [CNV-6]."""

BLENDER_CAMERA = Engine(
    _RIGHT_FORWARD_UP, _Y_AND_Z_FLIPPED, 1.0, _blender_camera_from_wire, _blender_camera_to_wire
)
"""A camera in Blender, which looks along its own −z [CNV-6]."""

OPENGL = Engine(_Y_AND_Z_FLIPPED, _Y_AND_Z_FLIPPED, 1.0, _opengl, _opengl)
"""OpenGL whose world has y up; camera and object [CNV-7]."""

OPENGL_CAMERA = Engine(
    _SAME, _Y_AND_Z_FLIPPED, 1.0, _opengl_camera_from_wire, _opengl_camera_to_wire
)
"""A camera that looks along its own −z in a world that keeps the wire's axes (nerfstudio, glTF)."""

ENGINES = {
    "unity": UNITY,
    "unreal": UNREAL,
    "blender_object": BLENDER_OBJECT,
    "blender_camera": BLENDER_CAMERA,
    "opengl": OPENGL,
    "opengl_camera": OPENGL_CAMERA,
}
