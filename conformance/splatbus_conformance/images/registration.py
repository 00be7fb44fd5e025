"""From which camera an image of the closed-form scene was really rendered, in digits.

Every covered pixel gives a point that has to lie on the surface it shows. The affine map that takes
the points there by least squares, point to plane (Chen and Medioni 1991), is the camera's error.
"""

from typing import NamedTuple

import numpy as np

from splatbus_conformance.images.known_scene import BALL, BOBS, NOTHING, ExactImage, surface
from splatbus_conformance.images.pinhole import Camera, Reals, Rigid

LEAST_POINTS = 200
OUTLIER = 6.0
"""Points that are off by so many times the median are left out: they lie on something else."""
SMALLEST = 1e-6
ROUNDS = 4
WORST_CONDITION = 1e10
"""Of the normal equations: beyond it, too few directions of surfaces are seen."""


class Registration(NamedTuple):
    """The camera by which an image was rendered: X_world = rotation·X_cam + position."""

    rotation: Reals
    """(3, 3), whatever was used for a rotation matrix."""
    position: Reals
    """(3,), the camera's centre."""
    uncertainty: float
    """Standard error of the worst of these numbers, from what the points leave unexplained."""

    @property
    def translation(self) -> Reals:
        """t = −Rᵀ·c of the view matrix."""
        moved: Reals = -self.rotation.T @ self.position
        return moved

    @property
    def shear(self) -> float:
        """‖RᵀR − I‖₂."""
        return float(np.linalg.norm(self.rotation.T @ self.rotation - np.eye(3), 2))


def register(camera: Camera, depth: Reals, exact: ExactImage, scene: Rigid) -> Registration | None:
    """Find the camera; None if too little is seen. What may move by itself does not count.

    Args:
        camera: as the frame names it.
        depth: (h, w), planar, +∞ where empty.
        exact: what the camera would see.
        scene: where the scene lies.
    """
    seen = np.isfinite(depth) & (exact.what != NOTHING) & exact.certain
    seen &= ~np.isin(exact.what // 2, (BALL, BOBS))
    if seen.sum() < LEAST_POINTS:
        return None
    points = depth[seen][:, None] * camera.rays()[seen]
    # In the axes of the scene, so that a place far from the origin costs no digits.
    origin = scene.sees(camera.pose.position)
    turn = scene.rotation.T @ camera.pose.rotation
    distance, normal = surface(exact.what[seen], points @ turn.T + origin)
    unknowns = np.concatenate(
        ((normal[:, :, None] * points[:, None, :]).reshape(-1, 9), normal), axis=1
    )
    left = np.abs(distance)
    # What the linear map leaves by itself, on curved surfaces, makes no point an outlier.
    curved = float(np.median(left)) ** 2
    for _ in range(ROUNDS):
        kept = left <= OUTLIER * max(float(np.median(left)), curved, SMALLEST)
        some = unknowns[kept]
        square = some.T @ some
        if kept.sum() < LEAST_POINTS or np.linalg.cond(square) > WORST_CONDITION:
            return None
        found = np.linalg.solve(square, -some.T @ distance[kept])
        left = np.abs(unknowns @ found + distance)
    covariance = np.linalg.inv(square) * float(np.mean(left[kept] ** 2))
    return Registration(
        scene.rotation @ (turn + found[:9].reshape(3, 3)),
        camera.pose.position + scene.rotation @ found[9:],
        float(np.sqrt(covariance.diagonal().max())),
    )
