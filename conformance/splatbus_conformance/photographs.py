"""Images that a server lent: copies of their pixels, and what their frames say of the camera."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS

from splatbus_conformance.closed_form import AT_REST, COLOR_BUDGET, KNOWN, Setting, render
from splatbus_conformance.memory_reading import Opened, Pixels
from splatbus_conformance.messages import Json
from splatbus_conformance.pinhole import Camera, Reals, camera_of
from splatbus_conformance.reprojection import View
from splatbus_conformance.stress import Pose
from splatbus_conformance.values import finite, whole, within

LEGACY_EMPTY: float = LIMITS["legacy_empty_depth"]


class Photograph(NamedTuple):
    """A frame, what it says of its camera, and its pixels; rows top-down."""

    frame: Json
    camera: Camera
    color: Pixels
    """(h, w, 4)."""
    depth: Pixels
    """(h, w), as stored."""
    semantics: Json
    """Of the init packet."""

    @property
    def pose(self) -> Pose:
        """The camera's, as named on the wire."""
        named = self.frame["camera"]
        return Pose(tuple(map(float, named["position"])), tuple(map(float, named["rotation"])))

    def view(self) -> View:
        """For `reprojection`."""
        position, rotation = self.pose
        return View(self.camera, position, rotation, self.planar())

    def covered(self) -> NDArray[np.bool_]:
        """(h, w): the pixel holds the depth of a surface."""
        depth = self.depth
        with np.errstate(invalid="ignore"):
            return np.isfinite(depth) & (depth > 0) & ~np.isin(depth, self.empties())

    def planar(self) -> Reals:
        """(h, w): planar depth, +∞ where empty."""
        depth = np.where(self.covered(), self.depth, np.inf).astype(np.float64)
        if within(self.semantics, "depth", "kind") == "ray_distance":
            depth /= np.linalg.norm(self.camera.rays(), axis=-1)
        return depth

    def empties(self) -> Pixels:
        """The finite depths that mean an empty pixel."""
        announced = finite(within(self.semantics, "depth", "empty"))
        with np.errstate(over="ignore"):
            return np.array(
                [LEGACY_EMPTY, LEGACY_EMPTY if announced is None else announced], np.float32
            )


def photograph_of(frame: Json, memory: Opened, init_packet: Json) -> Photograph | None:
    """A copy of what lies in the slot that a frame names.

    None if it is not of this memory, names no slot of it, or no camera of its size (IMG-1).
    """
    slot, camera = whole(frame.get("slot"), 0), camera_of(frame)
    if slot is None or slot >= memory.layout.slots or camera is None:
        return None
    size = memory.layout.width, memory.layout.height
    if frame.get("generation") != memory.generation or (camera.width, camera.height) != size:
        return None
    semantics = init_packet.get("semantics")
    return Photograph(
        frame,
        camera,
        memory.color(slot),
        memory.depth(slot),
        semantics if isinstance(semantics, dict) else {},
    )


def shows_the_scene(photograph: Photograph, setting: Setting = AT_REST) -> bool:
    """Whether this is the scene of `conformance/SCENE.md`: by its depths, and by its colours in
    whatever order, so that a wrong order of them is found.
    """
    with np.errstate(all="ignore"):  # a camera may be anywhere
        exact = render(photograph.camera, setting)
        right = exact.depth_is_right(photograph.planar())
        off = np.abs(np.sort(photograph.color, axis=-1) - np.sort(exact.color, axis=-1))
        right &= (off <= COLOR_BUDGET).all(axis=-1)
    return bool(photograph.covered().any() and right[exact.certain].mean() >= KNOWN)
