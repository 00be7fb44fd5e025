"""A pinhole camera as a `frame` names it: rays, and points before it (spec 1.0 section 7.1)."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.wire.json_values import finite, finites, whole, within
from splatbus_conformance.wire.messages import Json

Reals = NDArray[np.float64]
Whole = NDArray[np.int64]
ORIGIN: Reals = np.zeros(3)
IDENTITY: Reals = np.eye(3)
MIN_NORM = 1e-6
"""Of a rotation that can be reckoned with; POS-3 wants 1."""


class Rigid(NamedTuple):
    """A rotation matrix (3, 3) and a position (3,), from axes of its own to the world's."""

    rotation: Reals = IDENTITY
    position: Reals = ORIGIN

    def place(self, points: Reals) -> Reals:
        """Points (…, 3) of its own, in the world."""
        moved: Reals = points @ self.rotation.T + self.position
        return moved

    def sees(self, points: Reals) -> Reals:
        """Points (…, 3) of the world, in its own axes; the position is subtracted first."""
        seen: Reals = (points - self.position) @ self.rotation
        return seen

    def inverse(self) -> "Rigid":
        """From the world's axes to its own."""
        return Rigid(self.rotation.T, -self.rotation.T @ self.position)


class ObjectPlacement(NamedTuple):
    """Where an object lies, and how large: X_world = scale · rotation · X + position (OBJ-1)."""

    pose: Rigid = Rigid()
    scale: float = 1.0

    def place(self, points: Reals) -> Reals:
        """Points (…, 3) of the object, in the world."""
        return self.pose.place(self.scale * points)


STILL = ObjectPlacement()


class Camera(NamedTuple):
    """A pose in the world, camera-to-world, and intrinsics in pixels; pixel centres at halves."""

    pose: Rigid
    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near: float
    far: float

    def rays(self) -> Reals:
        """(h, w, 3), top row first: where each pixel looks, in camera axes, with z = 1."""
        columns, rows = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return self.rays_at(columns, rows)

    def rays_at(self, columns: Whole, rows: Whole) -> Reals:
        """(…, 3): where these pixels look, in camera axes, with z = 1."""
        across = (columns + 0.5 - self.cx) / self.fx
        down = (rows + 0.5 - self.cy) / self.fy
        return np.stack((across, down, np.ones_like(across)), axis=-1)


def rotation_matrix(q: Sequence[float]) -> Reals:
    """The rotation of q/‖q‖ for q = (x, y, z, w), Hamilton, in double precision."""
    x, y, z, w = q
    s = 2.0 / (x * x + y * y + z * z + w * w)
    square = w * w, x * x, y * y, z * z
    diagonal = [s / 2.0 * float(np.dot(square, signs)) for signs in _SIGNS]
    return np.array(
        (
            (diagonal[0], s * (x * y - z * w), s * (x * z + y * w)),
            (s * (x * y + z * w), diagonal[1], s * (y * z - x * w)),
            (s * (x * z - y * w), s * (y * z + x * w), diagonal[2]),
        )
    )


_SIGNS = ((1, 1, -1, -1), (1, -1, 1, -1), (1, -1, -1, 1))


def rigid(position: Sequence[float], rotation: Sequence[float]) -> Rigid:
    """A pose as it stands on the wire."""
    return Rigid(rotation_matrix(rotation), np.array(position, np.float64))


def told_pose(told: object) -> Rigid | None:
    """The pose that a frame tells of its camera or of an object; None where that is none."""
    position = finites(within(told, "position"), 3)
    rotation = finites(within(told, "rotation"), 4)
    if position is None or rotation is None or not MIN_NORM < math.hypot(*rotation) < 1 / MIN_NORM:
        return None
    return rigid(position, rotation)


def told_of(frame: Json, name: str) -> Json | None:
    """What a frame says of an object; None if it does not list it."""
    held = frame.get("objects")
    found = [it for it in held if isinstance(it, dict)] if isinstance(held, list) else []
    return next((it for it in found if it.get("object") == name), None)


def placed_in(frame: Json, name: str) -> ObjectPlacement:
    """Where a frame says that an object was; at rest, if it lists it not, or badly (OBJ-7)."""
    told = told_of(frame, name)
    pose, scale = told_pose(told), finite(within(told, "scale"))
    return STILL if pose is None or scale is None else ObjectPlacement(pose, scale)


def camera_of(frame: Json) -> Camera | None:
    """The camera that a frame names; None where that is none (IMG-1 says so)."""
    named = within(frame, "camera")
    pose = told_pose(named)
    lens = finites([within(named, name) for name in ("fx", "fy", "cx", "cy", "near", "far")], 6)
    width, height = (whole(within(named, name), 1) for name in ("width", "height"))
    if pose is None or lens is None or width is None or height is None or min(lens[:2]) <= 0:
        return None
    fx, fy, cx, cy, near, far = lens
    return Camera(pose, fx, fy, cx, cy, width, height, near, far)
