"""A ring for splats to be composed with, drawn in closed form."""

import numpy as np
from numpy.typing import NDArray

from splatbus_client.display import Float32Array, Shown, rays

OUTSIDE = ((0.98, 0.62, 0.12), (0.85, 0.42, 0.05))
INSIDE = ((0.62, 0.68, 0.78), (0.46, 0.52, 0.63))
_AXIS = np.array([0.24, -0.88, -0.41]) / np.linalg.norm([0.24, -0.88, -0.41])
_LIGHT = np.array([-0.45, -0.6, -0.66]) / np.linalg.norm([-0.45, -0.6, -0.66])
_CHECKS = 36


def ring_around(image: Shown) -> tuple[Float32Array, Float32Array]:
    """Draw a tilted ring around what is in the middle of an image: before it, and behind it.

    Returns:
        (H, W, 3) float32 colour, and (H, W) float32 planar depth, +∞ where the ring is not.
    """
    middle = _middle_depth(image)
    radius = 0.45 * middle
    ray = rays(image.camera)
    center = np.array([0.0, 0.0, middle + 0.75 * radius])
    return _draw(ray, center, radius, 0.13 * radius)


def _middle_depth(image: Shown) -> float:
    """The depth of the covered pixel nearest to the principal point; 3 if there is none."""
    rows, columns = np.nonzero(np.isfinite(image.depth))
    if not len(rows):
        return 3.0
    distance = np.hypot(rows + 0.5 - image.camera.cy, columns + 0.5 - image.camera.cx)
    nearest = np.argmin(distance)
    return float(image.depth[rows[nearest], columns[nearest]])


def _draw(
    ray: NDArray[np.float64], center: NDArray[np.float64], radius: float, half_height: float
) -> tuple[Float32Array, Float32Array]:
    """Where z·ray first meets an open cylinder around `_AXIS`, seen from within and without.

    With p the part of a vector across the axis, |z·p(ray) − p(center)| = radius is a quadratic
    equation in z, the planar depth.
    """
    across_ray, across_center = _across(ray), _across(center)
    a = np.sum(across_ray**2, axis=-1)
    b = across_ray @ across_center
    discriminant = b * b - a * (across_center @ across_center - radius**2)
    root = np.sqrt(np.maximum(discriminant, 0.0))

    depth = np.full(ray.shape[:2], np.inf)
    for z in ((b + root) / a, (b - root) / a):  # the nearer one last
        height = z * (ray @ _AXIS) - center @ _AXIS
        hit = (discriminant > 0) & (z > 0) & (np.abs(height) <= half_height)
        depth = np.where(hit, z, depth)

    hit = np.isfinite(depth)
    outward = (np.where(hit, depth, 0.0)[..., None] * across_ray - across_center) / radius
    right = np.cross(_AXIS, [0.0, 0.0, 1.0])
    angle = np.arctan2(outward @ right, outward @ np.cross(right, _AXIS))
    check = (np.floor(angle / (2 * np.pi) * _CHECKS) % 2).astype(int)
    from_within = (np.sum(outward * ray, axis=-1) > 0).astype(int)
    albedo = np.array([OUTSIDE, INSIDE])[from_within, check]
    facing = np.where(from_within == 1, -1.0, 1.0) * (outward @ _LIGHT)
    color = albedo * (0.6 + 0.4 * np.clip(facing, 0.0, 1.0))[..., None]
    return np.where(hit[..., None], color, 0.0).astype(np.float32), depth.astype(np.float32)


def _across(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    result: NDArray[np.float64] = vector - (vector @ _AXIS)[..., None] * _AXIS
    return result
