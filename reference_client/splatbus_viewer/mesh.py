"""A ring for splats to be composed with, drawn in closed form."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.messages import FrameCamera, Placement
from splatbus_wire.poses import as_array
from splatbus_wire.relative import object_to_camera

from splatbus_viewer.display import Float32Array, Shown, rays

OUTSIDE = ((0.98, 0.62, 0.12), (0.85, 0.42, 0.05))
INSIDE = ((0.62, 0.68, 0.78), (0.46, 0.52, 0.63))
_AXIS = np.array([0.24, -0.88, -0.41]) / np.linalg.norm([0.24, -0.88, -0.41])
_LIGHT = np.array([-0.45, -0.6, -0.66]) / np.linalg.norm([-0.45, -0.6, -0.66])
_CHECKS = 36
Float64Array = NDArray[np.float64]


class Ring(NamedTuple):
    """An open cylinder, in some axes.

    Attributes:
        center: (3,) its middle.
        axis: (3,) of length 1.
        first: (3,) of length 1 and across the axis, where the pattern on it begins.
        radius: in units of the axes.
        half_height: in units of the axes, to either side of the middle.
    """

    center: Float64Array
    axis: Float64Array
    first: Float64Array
    radius: float
    half_height: float


def ring_around(image: Shown) -> tuple[Float32Array, Float32Array]:
    """Draw a tilted ring around what is in the middle of an image: before it, and behind it.

    Returns:
        (H, W, 3) float32 colour, and (H, W) float32 planar depth, +∞ where the ring is not.
    """
    middle = _middle_depth(image)
    radius = 0.45 * middle
    center = np.array([0.0, 0.0, middle + 0.75 * radius])
    return drawn(tilted(center, radius), image.camera)


def tilted(center: Float64Array, radius: float) -> Ring:
    """Return a ring that is tilted as one likes to see it, low for its width."""
    first = np.cross(_AXIS, [0.0, 0.0, 1.0])
    return Ring(center, _AXIS, first / np.linalg.norm(first), radius, 0.13 * radius)


def bound(ring: Ring, placement: Placement, camera: FrameCamera) -> Ring:
    """Take a ring that belongs to an object from the object's axes to the camera's.

    A point X of the object lies at scale · R · X + position in the world [OBJ-1]. Both arguments
    have to be of one frame, so that ring and splats move as one [OBJ-7].
    """
    matrix = as_array(object_to_camera(camera.pose, placement.pose))
    turn, shift = matrix[:3, :3], matrix[:3, 3]
    return Ring(
        turn @ (placement.scale * ring.center) + shift,
        turn @ ring.axis,
        turn @ ring.first,
        placement.scale * ring.radius,
        placement.scale * ring.half_height,
    )


def _middle_depth(image: Shown) -> float:
    """The depth of the covered pixel nearest to the principal point; 3 if there is none."""
    rows, columns = np.nonzero(np.isfinite(image.depth))
    if not len(rows):
        return 3.0
    distance = np.hypot(rows + 0.5 - image.camera.cy, columns + 0.5 - image.camera.cx)
    nearest = np.argmin(distance)
    return float(image.depth[rows[nearest], columns[nearest]])


def drawn(ring: Ring, camera: FrameCamera) -> tuple[Float32Array, Float32Array]:
    """Draw a ring that is given in the camera's axes, seen from within and without.

    With p the part of a vector across the axis, |z·p(ray) − p(center)| = radius is a quadratic
    equation in z, the planar depth.

    Returns:
        (H, W, 3) float32 colour, and (H, W) float32 planar depth, +∞ where the ring is not.
    """
    ray = rays(camera)
    across_ray, across_center = _across(ray, ring.axis), _across(ring.center, ring.axis)
    a = np.sum(across_ray**2, axis=-1)
    b = across_ray @ across_center
    discriminant = b * b - a * (across_center @ across_center - ring.radius**2)
    root = np.sqrt(np.maximum(discriminant, 0.0))

    depth = np.full(ray.shape[:2], np.inf)
    for z in ((b + root) / a, (b - root) / a):  # the nearer one last
        height = z * (ray @ ring.axis) - ring.center @ ring.axis
        hit = (discriminant > 0) & (z > 0) & (np.abs(height) <= ring.half_height)
        depth = np.where(hit, z, depth)

    hit = np.isfinite(depth)
    outward = (np.where(hit, depth, 0.0)[..., None] * across_ray - across_center) / ring.radius
    angle = np.arctan2(outward @ ring.first, outward @ np.cross(ring.first, ring.axis))
    check = (np.floor(angle / (2 * np.pi) * _CHECKS) % 2).astype(int)
    from_within = (np.sum(outward * ray, axis=-1) > 0).astype(int)
    albedo = np.array([OUTSIDE, INSIDE])[from_within, check]
    facing = np.where(from_within == 1, -1.0, 1.0) * (outward @ _LIGHT)
    color = albedo * (0.6 + 0.4 * np.clip(facing, 0.0, 1.0))[..., None]
    return np.where(hit[..., None], color, 0.0).astype(np.float32), depth.astype(np.float32)


def _across(vector: Float64Array, axis: Float64Array) -> Float64Array:
    result: Float64Array = vector - (vector @ axis)[..., None] * axis
    return result
