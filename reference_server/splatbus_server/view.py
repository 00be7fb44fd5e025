"""What a renderer is asked for: matrices in double precision, computed when they are read."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from splatbus_wire import relative
from splatbus_wire.intrinsics import Pinhole
from splatbus_wire.lens import Lens
from splatbus_wire.messages import DEFAULT_OBJECT, Placement
from splatbus_wire.poses import Pose, Vector, as_array, view_matrix, world_matrix
from splatbus_wire.relative import PixelErrors, RelativeView

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


def lens_of(intrinsics: Intrinsics, width: int, height: int) -> Lens:
    """The intrinsics of an image of this size, in pixels."""
    fx, fy, cx, cy, near, far = intrinsics
    return Lens(fx, fy, cx, cy, width, height, near, far)


def without_size(lens: Lens) -> Intrinsics:
    """The intrinsics alone."""
    return Intrinsics(*lens[:4], *lens[6:])


def field_of_view(width: int, height: int, vertical_degrees: float = 60.0) -> Intrinsics:
    """Square pixels, the principal point in the middle of the image."""
    focal = height / (2.0 * math.tan(math.radians(vertical_degrees) / 2.0))
    return Intrinsics(focal, focal, width / 2.0, height / 2.0)


@dataclass(frozen=True, eq=False)
class View:
    """One image to render; every matrix is (4, 4) float64 and multiplies column vectors.

    Axes are OpenCV's (x right, y down, z forward), for the world as for the camera [CNV-1].

    Its object's points X lie at scale·R·X + position in the world [OBJ-1]. Every depth that comes
    of these matrices is in units of the world, whatever the scale [OBJ-6].

    Attributes:
        poses: camera-to-world, where each object is, and what else clients asked for.
        intrinsics: in pixels of this width and height.
        width: pixels.
        height: pixels.
        wants: which of `color` and `depth` clients read; the others need not be rendered [IMG-21].
        generation: of the memory that the image is for.
        origin: of the scene, float64, as announced in `semantics`: a position in the scene's own
            coordinates is one on the wire plus this.
        object: whose Gaussians the matrices are for; see `of`.
    """

    poses: Poses
    intrinsics: Intrinsics
    width: int
    height: int
    wants: frozenset[str]
    generation: int
    origin: Vector = relative.NO_ORIGIN
    object: str = DEFAULT_OBJECT

    def of(self, name: str) -> View:
        """The same view of another object of the scene.

        Raises:
            KeyError: the scene has no such object.
        """
        if name not in self.poses.objects:
            raise KeyError(f"no object {name!r}: the scene has {', '.join(self.poses.objects)}")
        return replace(self, object=name)

    @property
    def placement(self) -> Placement:
        """Where the object is, and how large."""
        return self.poses.objects[self.object]

    @property
    def time(self) -> float | None:
        """In the scene, seconds, what to render [TIM-2]; None: as the renderer likes."""
        return self.poses.time

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
        matrix: Matrix = as_array(world_matrix(self.placement.pose))
        matrix[:, :3] *= self.placement.scale
        return matrix

    @cached_property
    def object_to_camera(self) -> Matrix:
        """The view matrix for Gaussians in their own axes: one matrix moves them all.

        The camera's centre is subtracted before it is rotated, so that two large numbers that
        nearly cancel do so exactly. Round it once: `view.object_to_camera.astype(np.float32)`.
        """
        return self.tile_to_camera(self.origin)

    def tile_to_camera(self, origin: Vector) -> Matrix:
        """The view matrix for Gaussians that are counted from `origin`, as a tile's are.

        Args:
            origin: float64, in the scene's own coordinates.
        """
        return as_array(relative.object_to_camera(*self._seen_from(origin)))

    def eye(self, origin: Vector | None = None) -> Vector:
        """The camera's centre in the axes and units of the Gaussians.

        For doing what `camera_relative` does where the Gaussians are, such as on a GPU: the
        difference in float64, cast once, or by `splatbus_wire.relative.two_floats` in float32.

        Args:
            origin: what the Gaussians are counted from, float64, in the scene's own coordinates;
                the scene's `origin` if not given.
        """
        return relative.camera_in_object(*self._seen_from(origin))

    def camera_relative(
        self,
        points: ArrayLike,
        origin: Vector | None = None,
        *,
        out: NDArray[np.float32] | None = None,
    ) -> RelativeView:
        """The Gaussians counted from the camera's centre, and the matrix for them, in float32.

        As accurate at 10⁶ units from the origin as at 1: the centre is subtracted in float64, and
        the difference rounded once. The camera's centre is (0, 0, 0) to the renderer.

        Args:
            points: (N, 3), positions in their own axes, counted from `origin`, float32 or float64.
            origin: float64, in the scene's own coordinates; the scene's `origin` if not given.
                (0, 0, 0) for positions in those coordinates, which should then be float64.
            out: (N, 3) float32 to write the points to.

        Raises:
            ValueError: the points, or `out`, have another shape.
        """
        return relative.relative_view(points, *self._seen_from(origin), out=out)

    def pixel_errors(self, points: ArrayLike, origin: Vector | None = None) -> PixelErrors:
        """What single precision costs these points in this view, plainly and camera-relative.

        For a look now and then: it takes some 200 bytes a point. A sample of the points will do.

        Args:
            points: as in `camera_relative`.
            origin: as in `camera_relative`.
        """
        pinhole = Pinhole(*self.intrinsics[:4], self.width, self.height)
        near, far = self.intrinsics.near, self.intrinsics.far
        return relative.pixel_errors(points, pinhole, near, far, *self._seen_from(origin))

    def _seen_from(self, origin: Vector | None) -> tuple[Pose, Pose, Vector, float]:
        """Camera, object, what its points are counted from (in its own axes), and its scale."""
        _, pose, scale = self.placement
        if origin is None:
            return self.poses.camera, pose, relative.NO_ORIGIN, scale
        x, y, z = (a - b for a, b in zip(origin, self.origin))
        return self.poses.camera, pose, (x, y, z), scale
