"""A pinhole camera as a `frame` names it: rays, and points before it (spec 1.0 section 7.1)."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.messages import Json
from splatbus_conformance.values import is_number, numbers

Reals = NDArray[np.float64]
ORIGIN: Reals = np.zeros(3)
IDENTITY: Reals = np.eye(3)


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


class Placed(NamedTuple):
    """Where an object lies, and how large: X_world = scale · rotation · X + position (OBJ-1)."""

    pose: Rigid = Rigid()
    scale: float = 1.0

    def place(self, points: Reals) -> Reals:
        """Points (…, 3) of the object, in the world."""
        return self.pose.place(self.scale * points)


STILL = Placed()


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
        x = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        y = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        across, down = np.meshgrid(x, y)
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


def told_of(frame: Json, name: str) -> Json | None:
    """What a frame says of an object; None if it does not list it."""
    held = frame.get("objects")
    found = [it for it in held or [] if isinstance(it, dict)] if isinstance(held, list) else []
    return next((it for it in found if it.get("object") == name), None)


def placed_in(frame: Json, name: str) -> Placed:
    """Where a frame says that an object was; at rest, if it lists it not, or badly (OBJ-7)."""
    told = told_of(frame, name) or {}
    position: Any = told.get("position")
    rotation: Any = told.get("rotation")
    scale: Any = told.get("scale")
    if numbers(position, 3) and numbers(rotation, 4) and is_number(scale):
        return Placed(rigid(position, rotation), float(scale))
    return STILL


def camera_of(frame: Json) -> Camera | None:
    """The camera that a frame names; None where that is none (IMG-1 says so)."""
    try:
        named = frame["camera"]
        position = [float(number) for number in named["position"]]
        rotation = [float(number) for number in named["rotation"]]
        fx, fy, cx, cy = (float(named[name]) for name in ("fx", "fy", "cx", "cy"))
        near, far = float(named["near"]), float(named["far"])
        width, height = int(named["width"]), int(named["height"])
    except (KeyError, TypeError, ValueError, OverflowError):
        return None
    numbers = (*position, *rotation, fx, fy, cx, cy, near, far)
    if (
        (len(position), len(rotation)) != (3, 4)
        or not all(map(math.isfinite, numbers))
        or not any(rotation)
        or min(width, height, fx, fy) <= 0
    ):
        return None
    return Camera(rigid(position, rotation), fx, fy, cx, cy, width, height, near, far)
