"""What a renderer is asked for: matrices in double precision, computed when they are read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.poses import as_array, view_matrix, world_matrix

from splatbus_server.control import Poses

Matrix = NDArray[np.float64]


class Intrinsics(NamedTuple):
    """A pinhole in pixels; (0.5, 0.5) is the centre of the top-left pixel.

    Surfaces between the planar depths `near` and `far` (scene units) are seen.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    near: float = 0.01
    far: float = 100.0


def field_of_view(width: int, height: int, vertical_degrees: float = 60.0) -> Intrinsics:
    """Square pixels, the principal point in the middle of the image."""
    focal = height / (2.0 * math.tan(math.radians(vertical_degrees) / 2.0))
    return Intrinsics(focal, focal, width / 2.0, height / 2.0)


@dataclass(frozen=True, eq=False)
class View:
    """One image to render; every matrix is (4, 4) float64 and multiplies column vectors.

    Axes are OpenCV's (x right, y down, z forward), for the world as for the camera [CNV-1].

    Attributes:
        poses: camera-to-world, and object-to-world of the Gaussians.
        intrinsics: in pixels of this width and height.
        width: pixels.
        height: pixels.
        wants: which of `color` and `depth` clients read; the others need not be rendered [IMG-21].
        generation: of the memory that the image is for.
    """

    poses: Poses
    intrinsics: Intrinsics
    width: int
    height: int
    wants: frozenset[str]
    generation: int

    @property
    def wants_depth(self) -> bool:
        """Whether a client reads depth."""
        return "depth" in self.wants

    @cached_property
    def world_to_camera(self) -> Matrix:
        """The view matrix [ACC-2, ACC-4]."""
        return as_array(view_matrix(self.poses.camera))

    @cached_property
    def object_to_world(self) -> Matrix:
        """Where the Gaussians are."""
        return as_array(world_matrix(self.poses.points))

    @cached_property
    def object_to_camera(self) -> Matrix:
        """The view matrix for Gaussians in their own axes: one matrix moves them all.

        The camera's centre is subtracted before it is rotated, so that two large numbers that
        nearly cancel do so exactly.
        """
        moved = self.object_to_world.copy()
        moved[:3, 3] -= self.poses.camera.position
        turned = self.world_to_camera.copy()
        turned[:3, 3] = 0.0
        return turned @ moved
