"""A few thousand Gaussians, drawn one after the other: slow, short, and exact enough for pictures.

Elliptical weighted averaging as in 3DGS: each Gaussian's covariance is projected by the Jacobian of
the perspective at its centre, and blended front to back (Kerbl et al. 2023).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_splats.drawing import harmonics
from splatbus_wire.rotations import rotation_matrix

from benchmarks.splats import turning

Floats = NDArray[Any]

LOW_PASS = 0.3
"""Added to a projected variance, in pixels²: no Gaussian is thinner than a pixel."""
LEAST_ALPHA = 1.0 / 255.0


class Gaussians(NamedTuple):
    """N of them, in the axes of the object."""

    means: Floats
    """(N, 3)"""
    rotations: Floats
    """(N, 4) quaternions x, y, z, w."""
    scales: Floats
    """(N, 3) standard deviations along their own axes."""
    opacities: Floats
    """(N,)"""
    coefficients: Floats
    """(16, 3, N) spherical harmonics."""


def moved(gaussians: Gaussians, position: Floats, rotation: Floats) -> Gaussians:
    """Positions and rotations transformed, and the spherical harmonics left as they are."""
    R = matrix(rotation).astype(gaussians.means.dtype)
    means = gaussians.means @ R.T + position.astype(gaussians.means.dtype)
    left = times_matrix(rotation).astype(gaussians.rotations.dtype)
    return gaussians._replace(means=means, rotations=gaussians.rotations @ left.T)


def matrix(q: Floats) -> Floats:
    """(3, 3) rotation matrix of a quaternion."""
    x, y, z, w = (float(a) for a in q)
    return np.array(rotation_matrix((x, y, z, w))).reshape(3, 3)


def times_matrix(q: Floats) -> Floats:
    """(4, 4) matrix of p ↦ q·p."""
    x, y, z, w = q
    return np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])


def covariances(gaussians: Gaussians) -> Floats:
    """(N, 3, 3)"""
    axes = np.stack([matrix(q) for q in gaussians.rotations]) * gaussians.scales[:, None, :]
    return np.asarray(axes @ axes.transpose(0, 2, 1))


def shown_colours(coefficients: Floats, offsets: Floats) -> Floats:
    """`harmonics.colours`, as a display shows them: at most 1."""
    return np.minimum(harmonics.colours(coefficients, offsets), 1)


def draw(
    gaussians: Gaussians, view: Floats, eye: Floats, focal: float, width: int, height: int
) -> Floats:
    """(height, width, 3) over black.

    Args:
        gaussians: in axes that `view` takes to camera axes.
        view: (4, 4).
        eye: (3,) the camera's centre in the Gaussians' axes.
        focal: in pixels.
        width: in pixels.
        height: in pixels.
    """
    turn = view[:3, :3].astype(np.float64)
    centres = gaussians.means @ turn.T + view[:3, 3]
    spread = turn @ covariances(gaussians) @ turn.T
    colours = shown_colours(gaussians.coefficients, gaussians.means - eye)
    image, left = np.zeros((height, width, 3)), np.ones((height, width))
    for k in np.argsort(centres[:, 2]):
        x, y, z = centres[k]
        if z < 0.1:
            continue
        J = np.array([[focal / z, 0, -focal * x / z**2], [0, focal / z, -focal * y / z**2]])
        flat = J @ spread[k] @ J.T + LOW_PASS * np.eye(2)
        u, v = focal * x / z + width / 2, focal * y / z + height / 2
        reach = 3 * np.sqrt(np.diag(flat))
        columns = np.arange(max(0, int(u - reach[0])), min(width, int(u + reach[0]) + 2))
        rows = np.arange(max(0, int(v - reach[1])), min(height, int(v + reach[1]) + 2))
        if not (len(columns) and len(rows)):
            continue
        a, b, c = np.linalg.inv(flat)[[0, 0, 1], [0, 1, 1]]
        dx, dy = (columns + 0.5 - u)[None], (rows + 0.5 - v)[:, None]
        power = -0.5 * (a * dx * dx + 2 * b * dx * dy + c * dy * dy)
        alpha = np.minimum(0.99, gaussians.opacities[k] * np.exp(power))
        alpha[alpha < LEAST_ALPHA] = 0.0
        box = np.ix_(rows, columns)
        image[box] += (left[box] * alpha)[..., None] * colours[k]
        left[box] *= 1 - alpha
    return image


def shiny_torus(count: int, seed: int = 1) -> Gaussians:
    """A checkered torus whose highlights, of a light that moves with it, are in its harmonics."""
    random = np.random.default_rng(seed)
    along, around = random.uniform(0, 2 * np.pi, (2, count))
    radius, thickness = 1.0, 0.42
    normal = np.stack(
        (np.cos(around) * np.cos(along), np.sin(around), np.cos(around) * np.sin(along)), axis=1
    )
    ring = np.stack((np.cos(along), np.zeros(count), np.sin(along)), axis=1)
    means = radius * ring + thickness * normal

    # A quaternion that turns z to the normal: the Gaussians are flat discs on the surface.
    q = np.stack((-normal[:, 1], normal[:, 0], np.zeros(count), 1 + normal[:, 2]), axis=1)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    scales = np.tile((0.045, 0.045, 0.008), (count, 1))

    checks = (np.floor(along * 8 / np.pi) + np.floor(around * 4 / np.pi)) % 2
    albedo = np.where(checks[:, None] == 0, (0.75, 0.25, 0.2), (0.2, 0.35, 0.6))
    light = np.array((0.4, -0.8, -0.45))
    light /= np.linalg.norm(light)
    mirrored = 2 * (normal @ light)[:, None] * normal - light
    directions = harmonics.spread_directions(120)
    gleam = np.clip(-mirrored @ directions.T, 0, 1) ** 6 * (normal @ light > 0)[:, None]
    diffuse = 0.45 + 0.4 * np.clip(normal @ light, 0, 1)
    values = (albedo * diffuse[:, None])[:, None] + 0.6 * gleam[..., None]
    return Gaussians(means, q, scales, np.full(count, 0.9), turning.fitted(values, directions))
