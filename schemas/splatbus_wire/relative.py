"""Views for single precision far from the origin: the camera's centre is subtracted first.

R·X + t loses, where the point X is near the camera, all the digits that R·X and −t share: in single
precision 0.06 units at 10⁶ units from the origin. R·(X − eye) does not, if the difference is taken
in double precision and rounded after. Rendering relative to the eye, or, with one matrix for all
points of a tile, relative to a centre, is what virtual globes do (P. Cozzi and K. Ring, 3D Engine
Design for Virtual Globes, 2011, chapter 5).

Everything is in the axes and units of the object: X_world = scale·R_object·(X + origin) + p
[OBJ-1]. `origin` is what points are counted from, (0, 0, 0) unless a scene is stored in tiles.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from splatbus_wire.intrinsics import Pinhole
from splatbus_wire.poses import IDENTITY, Matrix4, Pose, Vector, as_array
from splatbus_wire.rotations import rotation_matrix

Float32Array = NDArray[np.float32]

NO_ORIGIN: Vector = (0.0, 0.0, 0.0)


class RelativeView(NamedTuple):
    """Points counted from the camera's centre, and the matrix that takes them to camera axes.

    The camera's centre is (0, 0, 0) here, and the direction in which it sees a point, which
    spherical harmonics ask for, is the point itself.

    Attributes:
        points: (N, 3) float32, in the axes and units of the object.
        matrix: (4, 4) float32, [M | 0], M a rotation times the scale of the object.
    """

    points: Float32Array
    matrix: Float32Array


class PixelErrors(NamedTuple):
    """How far the worst of the points that are seen is from its place in the image, in pixels.

    Attributes:
        plain: `object_to_camera` and the points, both rounded to float32, multiplied in float32.
        camera_relative: the same with what `relative_view` gives.
        points_seen: the points in front of the camera and inside the image.
    """

    plain: float
    camera_relative: float
    points_seen: int


def camera_in_object(
    camera: Pose, object_pose: Pose = IDENTITY, origin: Vector = NO_ORIGIN, scale: float = 1.0
) -> Vector:
    """Return the camera's centre ("eye") in the axes and units of the object, from `origin`.

    R_objectᵀ·(c − p)/scale − origin, within 16u·(‖c − p‖/scale + ‖origin‖), and exact but for the
    two subtractions where the object is neither turned nor scaled.

    Args:
        camera: camera-to-world [CNV-1].
        object_pose: object-to-world [CNV-2].
        origin: what points are counted from, in the axes and units of the object.
        scale: of the object [OBJ-1].
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_matrix(object_pose.rotation)
    x, y, z = (c - p for c, p in zip(camera.position, object_pose.position))
    ox, oy, oz = origin
    return (
        (r00 * x + r10 * y + r20 * z) / scale - ox,
        (r01 * x + r11 * y + r21 * z) / scale - oy,
        (r02 * x + r12 * y + r22 * z) / scale - oz,
    )


def object_to_camera(
    camera: Pose, object_pose: Pose = IDENTITY, origin: Vector = NO_ORIGIN, scale: float = 1.0
) -> Matrix4:
    """Return [M | R_cameraᵀ·(p − c) + M·origin], M = scale·R_cameraᵀ·R_object, for such points.

    What comes out, depth above all, is in units of the world [OBJ-6].

    Rounded to single precision it misplaces a point X by about 2⁻²³·scale·(‖X‖ + ‖eye‖): good for
    an object, or a tile of a scene, that is small and near the camera, however far both are from
    the origin of the world.

    Args:
        camera: camera-to-world [CNV-1].
        object_pose: object-to-world [CNV-2].
        origin: what points are counted from, in the axes and units of the object.
        scale: of the object [OBJ-1].
    """
    a00, a01, a02, a10, a11, a12, a20, a21, a22 = rotation_matrix(camera.rotation)
    turn = rotation_matrix(object_pose.rotation)
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = (
        turn if scale == 1.0 else [scale * entry for entry in turn]
    )
    x, y, z = object_pose.position
    cx, cy, cz = camera.position
    ox, oy, oz = origin
    x = (x - cx) + (b00 * ox + b01 * oy + b02 * oz)
    y = (y - cy) + (b10 * ox + b11 * oy + b12 * oz)
    z = (z - cz) + (b20 * ox + b21 * oy + b22 * oz)
    return (
        a00 * b00 + a10 * b10 + a20 * b20,
        a00 * b01 + a10 * b11 + a20 * b21,
        a00 * b02 + a10 * b12 + a20 * b22,
        a00 * x + a10 * y + a20 * z,
        a01 * b00 + a11 * b10 + a21 * b20,
        a01 * b01 + a11 * b11 + a21 * b21,
        a01 * b02 + a11 * b12 + a21 * b22,
        a01 * x + a11 * y + a21 * z,
        a02 * b00 + a12 * b10 + a22 * b20,
        a02 * b01 + a12 * b11 + a22 * b21,
        a02 * b02 + a12 * b12 + a22 * b22,
        a02 * x + a12 * y + a22 * z,
        0.0,
        0.0,
        0.0,
        1.0,
    )


def relative_view(
    points: ArrayLike,
    camera: Pose,
    object_pose: Pose = IDENTITY,
    origin: Vector = NO_ORIGIN,
    scale: float = 1.0,
    *,
    out: Float32Array | None = None,
) -> RelativeView:
    """Return the points counted from the camera's centre, and [M | 0], both in single precision.

    The centre is subtracted in double precision and the difference rounded once: each component
    is within half an ULP, and 16u·(‖c − p‖/scale + ‖origin‖), of that of the points as given.
    Points in single precision that are themselves large stay on their own grid: see `origin`.

    Args:
        points: (N, 3), in the axes of the object, counted from `origin`; float32 or float64.
        camera: camera-to-world [CNV-1].
        object_pose: object-to-world [CNV-2].
        origin: what the points are counted from, in the axes and units of the object.
        scale: of the object [OBJ-1]; it is in the matrix, as in `object_to_camera`.
        out: (N, 3) float32 to write the points to.

    Raises:
        ValueError: the points, or `out`, have another shape.
    """
    given: NDArray[Any] = np.asarray(points)
    if given.ndim != 2 or given.shape[1] != 3:
        raise ValueError(f"points of shape {given.shape} are not (N, 3)")
    moved = np.empty(given.shape, np.float32) if out is None else out
    if moved.shape != given.shape or moved.dtype != np.float32:
        raise ValueError(f"out is {moved.dtype} of {moved.shape}, not float32 of {given.shape}")
    eye = camera_in_object(camera, object_pose, origin, scale)
    # Converted in small blocks inside the ufunc: no array of doubles is made.
    np.subtract(given, eye, out=moved, dtype=np.float64, casting="same_kind")
    at_the_object = camera._replace(position=object_pose.position)
    matrix = object_to_camera(at_the_object, object_pose, scale=scale)
    return RelativeView(moved, as_array(matrix, np.float32))


def two_floats(eye: Vector) -> tuple[Float32Array, Float32Array]:
    """Return high and low, (3,) float32 both, whose sum is `eye` to 48 bits.

    For renderers that have single precision only: (points − high) − low, in this order, misplaces
    a point of float32 coordinates by at most an ULP of the largest of ‖X − eye‖ and ULP(eye).
    The compiler must not be allowed to reorder it (-ffast-math adds high and low first).
    """
    high = np.array(eye, np.float32)
    return high, np.subtract(eye, high, dtype=np.float64).astype(np.float32)


def pixel_errors(
    points: ArrayLike,
    pinhole: Pinhole,
    near: float,
    far: float,
    camera: Pose,
    object_pose: Pose = IDENTITY,
    origin: Vector = NO_ORIGIN,
    scale: float = 1.0,
) -> PixelErrors:
    """Return what single precision costs these points in a view, plainly and camera-relative.

    It takes some 200 bytes a point.

    Args:
        points: as in `relative_view`, and so are `camera` to `scale`.
        pinhole: of the image, in pixels.
        near: planar depth from which on points are seen, units of the world.
        far: planar depth up to which they are.
    """
    given: NDArray[Any] = np.asarray(points)
    seen_from = (camera, object_pose, origin, scale)
    matrix = as_array(object_to_camera(*seen_from))
    eye = camera_in_object(*seen_from)
    in_camera = np.subtract(given, eye, dtype=np.float64) @ matrix[:3, :3].T
    right = pinhole.project(in_camera)
    z, (u, v) = in_camera[:, 2], right.T
    seen = (z >= near) & (z <= far)
    seen &= (u >= 0) & (u <= pinhole.width) & (v >= 0) & (v <= pinhole.height)
    with np.errstate(over="ignore", invalid="ignore"):
        single = given.astype(np.float32), matrix.astype(np.float32)
        moved = relative_view(given, *seen_from)
        plain, relative = (
            np.hypot(*(pinhole.project(its @ view[:3, :3].T + view[:3, 3]) - right)[seen].T)
            for its, view in (single, moved)
        )
    return PixelErrors(_worst(plain), _worst(relative), int(seen.sum()))


def _worst(errors: NDArray[np.float64]) -> float:
    """The largest; infinity where one is not even a number."""
    return float(np.nan_to_num(errors, nan=math.inf, posinf=math.inf).max(initial=0.0))
