"""Images that a server lent: copies of their pixels, and what their frames say of the camera."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.known_scene import (
    AT_REST,
    COLOR_BUDGET,
    FLOOR,
    KNOWN,
    NOTHING,
    ExactImage,
    SceneState,
    render,
)
from splatbus_conformance.images.memory.reading import Opened, Pixels
from splatbus_conformance.images.pinhole import Camera, Reals, camera_of
from splatbus_conformance.images.reprojection import DepthView
from splatbus_conformance.wire.json_values import finite, whole, within
from splatbus_conformance.wire.messages import Json

LEGACY_EMPTY: float = LIMITS["legacy_empty_depth"]

LEAST_SEEN = 0.05
"""The share of pixels that show something, from which an image tells whether it is of a scene."""
BESIDE, BESIDE_DEPTH, BESIDE_COLOR = 0.95, 0.02, 0.04
"""The share of pixels that hold what belongs there or next to it, from which a scene is drawn
beside its place; and by how much, relative, that may be something else still."""
JUST, UNEXPLAINED = 1e-4, 0.5
"""Inverse depths that are off by less, of the greatest, are as good as right; and the share of the
squares of what they are off by that no move of the image explains, up to which it was moved."""


class CapturedFrame(NamedTuple):
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

    def view(self) -> DepthView:
        """For `reprojection`."""
        position, rotation = self.pose
        return DepthView(self.camera, position, rotation, self.planar())

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


def photograph_of(frame: Json, memory: Opened, init_packet: Json) -> CapturedFrame | None:
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
    return CapturedFrame(
        frame,
        camera,
        memory.color(slot),
        memory.depth(slot),
        semantics if isinstance(semantics, dict) else {},
    )


def shows_the_scene(photograph: CapturedFrame, setting: SceneState = AT_REST) -> bool:
    """Whether this is the scene of `conformance/SCENE.md`: by its colours in whatever order, so
    that a wrong order of them is found, and so are wrong depths.

    So is one that is drawn beside its place, from another camera than the frame names.
    """
    with np.errstate(all="ignore"):  # a camera may be anywhere
        return _shows(photograph, render(photograph.camera, setting))


def _shows(photograph: CapturedFrame, exact: ExactImage) -> bool:
    something = photograph.covered() | (exact.what != NOTHING) | photograph.color.any(axis=-1)
    if min(photograph.covered().mean(), (exact.what != NOTHING).mean()) < LEAST_SEEN:
        return False
    color, wanted = np.sort(photograph.color, axis=-1), np.sort(exact.color, axis=-1)
    with np.errstate(invalid="ignore"):
        right = np.asarray((np.abs(color - wanted) <= COLOR_BUDGET).all(axis=-1))
    if right[exact.certain & something].mean() >= KNOWN:
        return True
    near = _is_around(photograph.planar()[..., None], exact.depth[..., None], BESIDE_DEPTH)
    near &= _is_around(color, wanted, BESIDE_COLOR)
    return bool(near[something].mean() >= BESIDE) and _is_moved(photograph, exact)


def _is_around(some: Reals | Pixels, others: Reals, slack: float) -> NDArray[np.bool_]:
    """(h, w): numbers that lie among those of the others at the pixel and around it, nearly."""
    wide = np.pad(others, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(wide, (3, 3), axis=(0, 1))
    with np.errstate(invalid="ignore"):
        least, most = around.min(axis=(-2, -1)), around.max(axis=(-2, -1))
        within = (some >= least - slack * least) & (some <= most + slack * most)
    found: NDArray[np.bool_] = within.all(axis=-1)
    return found


def _is_moved(photograph: CapturedFrame, exact: ExactImage) -> bool:
    """Depths within surfaces are those of pixels a little aside, all in one direction or turned
    about one point. Those of a renderer that blends what lies within a pixel are not.
    """
    surface = np.minimum(exact.what, FLOOR)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(surface, 1, mode="edge"), (3, 3))
    inner = (around == surface[..., None, None]).all(axis=(-2, -1))
    inner &= (surface != NOTHING) & photograph.covered()
    # The inverse depth of a plane is linear in the image.
    with np.errstate(divide="ignore"):
        wanted, given = 1.0 / exact.depth, 1.0 / photograph.planar()
    down, right = np.gradient(wanted)
    x, y = np.moveaxis(photograph.camera.rays()[..., :2], -1, 0)
    moves = np.stack((right, down, right * y - down * x), axis=-1)[inner]
    off = (given - wanted)[inner]
    if len(off) < moves.shape[-1] or np.abs(off).max() <= JUST * np.abs(wanted[inner]).max():
        return False
    unexplained = off - moves @ np.linalg.lstsq(moves, off, rcond=None)[0]
    return bool((unexplained**2).sum() <= UNEXPLAINED * (off**2).sum())
