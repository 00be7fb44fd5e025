"""Views for single precision far from the origin: the camera's centre is subtracted first.

R·X + t loses, where the point X is near the camera, all the digits that R·X and −t share: in single
precision 0.06 units at 10⁶ units from the origin. R·(X − eye) does not, if the difference is taken
in double precision and rounded after. Rendering relative to the eye, or, with one matrix for all
points of a tile, relative to a centre, is what virtual globes do (P. Cozzi and K. Ring, 3D Engine
Design for Virtual Globes, 2011, chapter 5).

Everything is in the axes of the object: X_world = R_object·(X + origin) + p. `origin` is what
points are counted from, (0, 0, 0) unless a scene is stored in tiles.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from splatbus_wire.poses import IDENTITY, Pose, Vector, as_array, view_matrix, world_matrix

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

NO_ORIGIN: Vector = (0.0, 0.0, 0.0)


class RelativeView(NamedTuple):
    """Points counted from the camera's centre, and the matrix that takes them to camera axes.

    The camera's centre is (0, 0, 0) here, and the direction in which it sees a point, which
    spherical harmonics ask for, is the point itself.

    Attributes:
        points: (N, 3) float32, in the axes of the object.
        matrix: (4, 4) float32, [R | 0].
    """

    points: Float32Array
    matrix: Float32Array


def camera_in_object(
    camera: Pose, object_pose: Pose = IDENTITY, origin: Vector = NO_ORIGIN
) -> Float64Array:
    """Return the camera's centre ("eye") in the axes of the object, counted from `origin`.

    R_objectᵀ·(c − p) − origin, (3,) float64, within 16u·(‖c − p‖ + ‖origin‖), and exact but for the
    two subtractions where the object is not turned.

    Args:
        camera: camera-to-world [CNV-1].
        object_pose: object-to-world [CNV-2].
        origin: what points are counted from, in the axes of the object.
    """
    offset = np.subtract(camera.position, object_pose.position)
    to_object = as_array(world_matrix(object_pose))[:3, :3].T
    return np.asarray(to_object @ offset - origin, np.float64)


def object_to_camera(
    camera: Pose, object_pose: Pose = IDENTITY, origin: Vector = NO_ORIGIN
) -> Float64Array:
    """Return [R | −R·eye], (4, 4) float64, for points counted from `origin`.

    Rounded to single precision it misplaces a point X by about 2⁻²³·(‖X‖ + ‖eye‖): good for an
    object, or a tile of a scene, that is small and near the camera, however far both are from the
    origin of the world.

    Args:
        camera: camera-to-world [CNV-1].
        object_pose: object-to-world [CNV-2].
        origin: what points are counted from, in the axes of the object.
    """
    matrix = _turn(camera, object_pose)
    matrix[:3, 3] = -(matrix[:3, :3] @ camera_in_object(camera, object_pose, origin))
    return matrix


def relative_view(
    points: ArrayLike,
    camera: Pose,
    object_pose: Pose = IDENTITY,
    origin: Vector = NO_ORIGIN,
    *,
    out: Float32Array | None = None,
) -> RelativeView:
    """Return the points counted from the camera's centre, and [R | 0], both in single precision.

    The centre is subtracted in double precision and the difference rounded once: each component
    is within half an ULP, and 16u·(‖c − p‖ + ‖origin‖), of that of the points as they are given.
    Points in single precision that are themselves large stay on their own grid: see `origin`.

    Args:
        points: (N, 3), in the axes of the object, counted from `origin`; float32 or float64.
        camera: camera-to-world [CNV-1].
        object_pose: object-to-world [CNV-2].
        origin: what the points are counted from, in the axes of the object.
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
    eye = camera_in_object(camera, object_pose, origin)
    # Converted in small blocks inside the ufunc: no array of doubles is made.
    np.subtract(given, eye, out=moved, dtype=np.float64, casting="same_kind")
    return RelativeView(moved, _turn(camera, object_pose).astype(np.float32))


def two_floats(eye: Float64Array) -> tuple[Float32Array, Float32Array]:
    """Return high and low, both float32, whose sum is `eye` to 48 bits.

    For renderers that have single precision only: (points − high) − low, in this order, misplaces
    a point of float32 coordinates by at most an ULP of the largest of ‖X − eye‖ and ULP(eye).
    The compiler must not be allowed to reorder it (-ffast-math adds high and low first).
    """
    high = eye.astype(np.float32)
    return high, (eye - high).astype(np.float32)


def _turn(camera: Pose, object_pose: Pose) -> Float64Array:
    """[R_cameraᵀ·R_object | 0]."""
    matrix: Float64Array = np.eye(4)
    to_camera = as_array(view_matrix(camera))[:3, :3]
    matrix[:3, :3] = to_camera @ as_array(world_matrix(object_pose))[:3, :3]
    return matrix
