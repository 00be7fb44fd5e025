"""The handles by which objects and the ring are moved, turned and scaled in the image."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui, imguizmo
from numpy.typing import NDArray
from splatbus_schemas import LIMITS
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.poses import Pose, Vector, as_array, view_matrix, world_matrix
from splatbus_wire.rotations import quaternion_from_matrix

from splatbus_viewer.window.drawing.ground import projection

_guizmo = imguizmo.im_guizmo
OPERATIONS = {
    "move": _guizmo.OPERATION.translate,
    "turn": _guizmo.OPERATION.rotate,
    "scale": _guizmo.OPERATION.scale,
}
_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""From camera axes with y down and z forward to those with y up and z backward."""
Float64Array = NDArray[np.float64]


def dragged(
    placement: Placement,
    middle: Vector,
    camera: FrameCamera,
    operation: str,
    area: tuple[float, float, float, float],
) -> Placement | None:
    """Draw the handles, and return where the user has put what they hold; None if nowhere else.

    Places are counted from the eye, so that single precision, which is the gizmo's, is enough
    however far the scene is from its origin.

    Args:
        placement: of what is held, object-to-world.
        middle: where its handles are, in its own axes.
        camera: of the image that is shown.
        operation: one of `OPERATIONS`.
        area: of the interface that the image covers: left, top, width, height.
    """
    _guizmo.set_drawlist(imgui.get_background_draw_list())
    _guizmo.set_rect(*area)
    _guizmo.set_orthographic(False)
    eye = camera.pose.position
    held = _guizmo.Matrix16(_columns(from_eye(placement, middle, eye)))
    view = as_array(view_matrix(camera.pose._replace(position=(0.0, 0.0, 0.0))))
    moved = _guizmo.manipulate(
        _guizmo.Matrix16(_columns(_TO_OPENGL @ view)),
        _guizmo.Matrix16(_columns(projection(camera) @ _TO_OPENGL)),
        OPERATIONS[operation],
        _guizmo.MODE.local if operation == "scale" else _guizmo.MODE.world,
        held,
    )
    if not moved:
        return None
    matrix = np.array(held.values, np.float64).reshape(4, 4).T
    return placed(placement.object, matrix, middle, eye)


def from_eye(placement: Placement, middle: Vector, eye: Vector) -> Float64Array:
    """Return (4, 4): from an object's axes to the world's [OBJ-1].

    The former are counted from its middle, the latter from the eye.
    """
    matrix = as_array(world_matrix(placement.pose))
    matrix[:3, :3] *= placement.scale
    matrix[:3, 3] += matrix[:3, :3] @ middle - eye
    return matrix


def placed(name: str, matrix: Float64Array, middle: Vector, eye: Vector) -> Placement:
    """Return the placement that `from_eye` makes such a matrix of.

    Its scale is the mean of the three axes', within what OBJ-1 allows, and its rotation the
    nearest one to what remains.
    """
    U, stretches, V = np.linalg.svd(matrix[:3, :3])
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    scale = min(max(float(np.mean(stretches)), LIMITS["min_scale"]), LIMITS["max_scale"])
    x, y, z = (matrix[:3, 3] + eye - scale * R @ middle).tolist()
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = R.ravel().tolist()
    rotation = quaternion_from_matrix((r00, r01, r02, r10, r11, r12, r20, r21, r22))
    return Placement(name, Pose((x, y, z), rotation), scale)


def _columns(matrix: Float64Array) -> list[float]:
    numbers: list[float] = matrix.T.ravel().tolist()
    return numbers
