"""Three balls and a ring: simple shapes, to measure with.

Three balls, a ring and a floor in front of a camera at the origin that looks along +z (y is down),
and far things all around. Gaussians are flat and lie on the surfaces, the more of them the smaller;
standard deviations are log-normal, opacities gather near 0 and 1, and harmonics of a higher degree
are fainter, as in what 3DGS trains.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.gaussians import COEFFICIENTS, Gaussians

Floats = NDArray[np.float64]

BALLS = (((0.0, 0.2, 4.0), 0.8), ((-1.7, 0.5, 4.8), 0.5), ((1.5, 0.6, 3.2), 0.4))
"""Centres and radii, scene units."""
RING = ((0.0, -0.6, 4.4), 1.5, 0.18)
"""Centre of a ring about the vertical axis, its radius, and that of its tube."""
FLOOR_HEIGHT, FLOOR_EXTENT = 1.0, 4.0
FAR = 20.0
SHARES = (0.2, 0.1, 0.1, 0.15, 0.35)
"""Of the balls, the ring and the floor; the rest is far away."""
SHARE_OPAQUE = 0.7
SPREADS = (0.0, 0.12, 0.07, 0.04)
"""Standard deviations of harmonics, by degree."""


def made(count: int, degree: int = 3, seed: int = 1) -> Gaussians:
    """A scene of `count` Gaussians with harmonics up to a degree from 0 to 3."""
    random = np.random.default_rng(seed)
    means, normals, sizes, albedos = _surfaces(count, random)
    scales = sizes[:, None] * np.exp(random.normal(0.0, 0.5, (count, 3)))
    scales[:, 2] *= 0.12
    is_opaque = random.random(count) < SHARE_OPAQUE
    opacities = np.where(is_opaque, random.beta(9.0, 1.0, count), random.beta(1.0, 6.0, count))
    coefficients = np.empty((count, COEFFICIENTS[degree], 3))
    coefficients[:, 0] = (albedos + random.normal(0.0, 0.06, (count, 3)) - 0.5) / CONSTANT
    for each in range(1, degree + 1):
        band = coefficients[:, COEFFICIENTS[each - 1] : COEFFICIENTS[each]]
        band[:] = random.normal(0.0, SPREADS[each], band.shape)
    turns = _facing(normals, random.uniform(0.0, 2.0 * np.pi, count))
    order = random.permutation(count)
    arrays = (means, turns, scales, opacities, coefficients)
    return Gaussians(*(array.astype(np.float32)[order] for array in arrays))


def _surfaces(count: int, random: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats]:
    """Points on them, normals, how large a Gaussian is there, and RGB."""
    counts = [int(share * count) for share in SHARES]
    counts.append(count - sum(counts))
    found = [
        _ball(counts[i], np.array(center), radius, _color(i), random)
        for i, (center, radius) in enumerate(BALLS)
    ]
    found.append(_ring(counts[3], random))
    found.append(_floor(counts[4], random))
    found.append(_ball(counts[5], np.zeros(3), FAR, np.array((0.45, 0.6, 0.8)), random))
    means, normals, sizes, albedos = (np.concatenate(each) for each in zip(*found))
    return means, normals, sizes, albedos


def _ball(
    count: int, center: Floats, radius: float, color: Floats, random: np.random.Generator
) -> tuple[Floats, Floats, Floats, Floats]:
    normals = random.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    bands = 0.75 + 0.25 * np.sign(np.sin(9.0 * normals[:, 1:2]))
    sizes = _sizes(4.0 * np.pi * radius**2, count)
    return center + radius * normals, normals, sizes, color * bands


def _ring(count: int, random: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats]:
    center, radius, tube = RING
    along, around = random.uniform(0.0, 2.0 * np.pi, (2, count))
    outward = np.stack((np.cos(along), np.zeros(count), np.sin(along)), axis=1)
    normals = np.cos(around)[:, None] * outward + np.sin(around)[:, None] * (0.0, 1.0, 0.0)
    means = np.array(center) + radius * outward + tube * normals
    is_odd = (np.sin(8.0 * along) > 0.0)[:, None]
    albedos = np.where(is_odd, (0.85, 0.75, 0.2), (0.25, 0.2, 0.5))
    return means, normals, _sizes(4.0 * np.pi**2 * radius * tube, count), albedos


def _floor(count: int, random: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats]:
    x, z = random.uniform(-FLOOR_EXTENT, FLOOR_EXTENT, (2, count))
    z += 4.0
    means = np.stack((x, np.full(count, FLOOR_HEIGHT), z), axis=1)
    is_odd = ((np.floor(x) + np.floor(z)) % 2.0 == 1.0)[:, None]
    albedos = np.where(is_odd, 0.25, 0.75) * np.ones(3)
    normals = np.tile((0.0, -1.0, 0.0), (count, 1))
    return means, normals, _sizes(4.0 * FLOOR_EXTENT**2, count), albedos


def _sizes(area: float, count: int) -> Floats:
    """Standard deviations with which so many Gaussians cover an area."""
    return np.full(count, 0.5 * np.sqrt(area / max(count, 1)))


def _color(i: int) -> Floats:
    return np.array(((0.85, 0.3, 0.25), (0.3, 0.7, 0.35), (0.3, 0.4, 0.85))[i])


def _facing(normals: Floats, spins: Floats) -> Floats:
    """Quaternions x, y, z, w that turn about z by the spin, then z to the normal."""
    x, y, z = normals.T
    w = 1.0 + z
    is_opposite = w < 1e-9
    a, b, w = np.where(is_opposite, 1.0, -y), np.where(is_opposite, 0.0, x), np.maximum(w, 0.0)
    s, c = np.sin(spins / 2.0), np.cos(spins / 2.0)
    turns = np.stack((a * c + b * s, b * c - a * s, w * s, w * c), axis=1)
    return np.asarray(turns / np.linalg.norm(turns, axis=1, keepdims=True))
