"""What a garden is made of: surfaces strewn with flat Gaussians, before light falls on them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

UPWARD = (0.0, -1.0, 0.0)
ROUGH, SHADE = 0.3, 0.2
"""By how much sizes and brightness scatter, log-normally."""


class Part(NamedTuple):
    """N Gaussians of one kind.

    Attributes:
        means: (N, 3), scene units.
        normals: (N, 3), unit vectors across which they are thin.
        along: (N, 3), directions of their longer axis; what of it lies on the normal is left out.
        scales: (N, 3), standard deviations along that, across it, and on the normal.
        albedos: (N, 3), linear RGB.
        gloss: (N,), how strongly the sun shows on it.
        thin: (N,), how much light comes through from behind.
    """

    means: Floats
    normals: Floats
    along: Floats
    scales: Floats
    albedos: Floats
    gloss: Floats
    thin: Floats


def part(
    random: np.random.Generator,
    means: Floats,
    normals: ArrayLike,
    along: ArrayLike,
    scales: ArrayLike,
    albedos: ArrayLike,
    gloss: float = 0.0,
    thin: float = 0.0,
) -> Part:
    """A part of arrays that are broadcast, with unit normals; sizes and brightness scatter."""
    count = len(means)
    normals, along, scales, albedos = (
        np.array(np.broadcast_to(np.asarray(each, np.float64), (count, 3)))
        for each in (normals, along, scales, albedos)
    )
    scales *= np.exp(random.normal(0.0, ROUGH, (count, 3)))
    albedos *= np.exp(random.normal(0.0, SHADE, (count, 1)))
    shares = np.full(count, gloss), np.full(count, thin)
    return Part(means, unit(normals), along, scales, albedos, *shares)


def joined(parts: Iterable[Part]) -> Part:
    """All of them, in their order."""
    return Part(*(np.concatenate(each) for each in zip(*parts)))


def unit(vectors: Floats) -> Floats:
    """(N, 3) of length 1."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def directions(count: int, random: np.random.Generator) -> Floats:
    """(count, 3) unit vectors, evenly over the sphere."""
    return unit(random.normal(size=(count, 3)))


def around(angles: Floats) -> Floats:
    """(N, 3) unit vectors in the plane of x and z."""
    return np.stack((np.cos(angles), np.zeros_like(angles), np.sin(angles)), axis=1)


def ring(count: int, random: np.random.Generator) -> Floats:
    """(count, 3) unit vectors in the plane of x and z, evenly."""
    return around(random.uniform(0.0, 2.0 * np.pi, count))


def disc(count: int, radius: float, random: np.random.Generator) -> Floats:
    """(count, 3) points in the plane of x and z, evenly over a disc about the origin."""
    return radius * np.sqrt(random.random((count, 1))) * ring(count, random)


def lifted(heights: ArrayLike) -> Floats:
    """(N, 3), what is to be added to points to lift them along y, which points down."""
    return np.multiply.outer(np.asarray(heights, np.float64), (0.0, 1.0, 0.0))


def turned(
    line: ArrayLike, count: int, random: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """What a line makes that is turned about the y axis: points, normals, and directions around.

    Args:
        line: points (y, radius); to its left, as one goes along it upwards, is outside.
        count: of the points, which lie evenly.
        random: where they lie.
    """
    ends = np.asarray(line, np.float64)
    steps = np.diff(ends, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    areas = lengths * (ends[1:, 1] + ends[:-1, 1])
    which = random.choice(len(steps), count, p=areas / areas.sum())
    heights, radii = (ends[which] + random.random((count, 1)) * steps[which]).T
    down, grows = (steps / lengths[:, None])[which].T
    outward = ring(count, random)
    normals = lifted(grows) - outward * down[:, None]
    return outward * radii[:, None] + lifted(heights), normals, np.cross(outward, UPWARD)


def clustered(
    count: int, centers: Floats, radii: ArrayLike, random: np.random.Generator
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Points within balls: (count,), of which ball each is, (count, 3), where in it, and where."""
    which = random.integers(0, len(centers), count)
    out = directions(count, random) * random.random((count, 1)) ** 0.5
    sizes = np.broadcast_to(np.asarray(radii, np.float64), centers.shape)
    return which, out, centers[which] + out * sizes[which]


def spread(area: float, count: int, share: float = 0.6) -> float:
    """Standard deviations with which so many Gaussians cover an area."""
    return share * float(np.sqrt(area / max(count, 1)))


def noise(points: Floats, size: ArrayLike, random: np.random.Generator) -> Floats:
    """(N,), a smooth random field about 0, of a standard deviation of 1: a sum of 24 waves.

    Args:
        points: (N, D).
        size: of its spots, in units of the points: one, or one for each axis.
        random: which field.
    """
    turns = random.normal(size=(points.shape[1], 24)) * 2.0
    phases = random.uniform(0.0, 2.0 * np.pi, 24)
    waves = np.cos((points / np.asarray(size, np.float64)) @ turns + phases)
    return np.asarray(waves.sum(axis=1) / np.sqrt(12.0))


def mixed(a: ArrayLike, b: ArrayLike, share: Floats) -> Floats:
    """(N, 3), of two colours, as much of the second as (N,) shares from 0 to 1 say."""
    t = np.clip(share, 0.0, 1.0)[:, None]
    return np.asarray(np.asarray(a) * (1.0 - t) + np.asarray(b) * t)


def turns_of(normals: Floats, along: Floats) -> Floats:
    """(N, 4), quaternions x, y, z, w that turn x to `along` and z to the normal.

    First z by half a turn about the middle between it and the normal, then about the normal.
    """
    halves = unit(normals - (0.0, 0.0, -1.0))
    halves[np.abs(halves).sum(axis=1) < 0.5] = (1.0, 0.0, 0.0)  # the normal is -z
    x, y, z = halves.T
    first = np.stack((2.0 * x * x - 1.0, 2.0 * x * y, 2.0 * x * z), axis=1)  # where x has come to
    sine = (np.cross(first, along) * normals).sum(axis=1)
    cosine = (first * along).sum(axis=1)
    angles = np.arctan2(sine, cosine)[:, None] / 2.0
    # (cos + n·sin)·(0 + h): of quaternions, n and h being vectors.
    dots = (normals * halves).sum(axis=1, keepdims=True)
    vectors = np.cos(angles) * halves + np.sin(angles) * np.cross(normals, halves)
    return np.concatenate((vectors, -np.sin(angles) * dots), axis=1)
