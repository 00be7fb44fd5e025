"""What scenes are made of: surfaces strewn with flat Gaussians, before light falls on them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


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
    means: Floats,
    normals: ArrayLike,
    along: ArrayLike,
    scales: ArrayLike,
    albedos: ArrayLike,
    gloss: float = 0.0,
    thin: float = 0.0,
) -> Part:
    """A part of arrays that are broadcast, with unit normals."""
    count = len(means)
    normals, along, scales, albedos = (
        np.array(np.broadcast_to(np.asarray(each, np.float64), (count, 3)))
        for each in (normals, along, scales, albedos)
    )
    shares = np.full(count, gloss), np.full(count, thin)
    return Part(means, unit(normals), along, scales, albedos, *shares)


def joined(parts: Iterable[Part]) -> Part:
    """All of them, in their order."""
    return Part(*(np.concatenate(each) for each in zip(*parts)))


def larger(it: Part, times: float) -> Part:
    """The same, so many times as large."""
    return it._replace(means=it.means * times, scales=it.scales * times)


def unit(vectors: Floats) -> Floats:
    """(N, 3) of length 1."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def directions(count: int, random: np.random.Generator) -> Floats:
    """(count, 3) unit vectors, evenly over the sphere."""
    return unit(random.normal(size=(count, 3)))


def disc(count: int, inner: float, outer: float, random: np.random.Generator) -> Floats:
    """(count, 2), places x and z, evenly over a ring about the origin."""
    radius = np.sqrt(random.uniform(inner**2, outer**2, count))
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    return np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)


def flat(places: Floats, height: ArrayLike) -> Floats:
    """(N, 3) points over (N, 2) places x and z, at a height on the y axis, which points down."""
    heights = np.broadcast_to(np.asarray(height, np.float64), len(places))
    return np.stack((places[:, 0], heights, places[:, 1]), axis=1)


def spread(area: float, count: int, share: float = 0.55) -> float:
    """Standard deviations with which so many Gaussians cover an area."""
    return share * float(np.sqrt(area / max(count, 1)))


def noise(points: Floats, size: ArrayLike, random: np.random.Generator, waves: int = 24) -> Floats:
    """(N,), a smooth random field about 0, of a standard deviation of 1.

    Args:
        points: (N, D).
        size: of its spots, in units of the points: one, or one for each axis.
        random: which field.
        waves: that it is the sum of.
    """
    turns = random.normal(size=(points.shape[1], waves)) * 2.0
    phases = random.uniform(0.0, 2.0 * np.pi, waves)
    return np.asarray(
        np.cos((points / np.asarray(size, np.float64)) @ turns + phases).sum(axis=1)
        / np.sqrt(waves / 2)
    )


def mixed(a: ArrayLike, b: ArrayLike, share: Floats) -> Floats:
    """(N, 3), of two colours, as much of the second as (N,) shares from 0 to 1 say."""
    t = np.clip(share, 0.0, 1.0)[:, None]
    return np.asarray(np.asarray(a) * (1.0 - t) + np.asarray(b) * t)


def turns_of(normals: Floats, along: Floats) -> Floats:
    """(N, 4), quaternions x, y, z, w that turn x to `along` and z to the normal."""
    x = unit(along - (along * normals).sum(axis=1, keepdims=True) * normals)
    y = np.cross(normals, x)
    m = np.stack((x, y, normals), axis=2)
    i, j, k = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    squares = np.stack((1 + i - j - k, 1 - i + j - k, 1 - i - j + k, 1 + i + j + k), axis=1)
    a, b, c = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    d, e, f = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    s0, s1, s2, s3 = squares.T
    rows = np.stack(
        (
            np.stack((s0, d, e, a), axis=1),
            np.stack((d, s1, f, b), axis=1),
            np.stack((e, f, s2, c), axis=1),
            np.stack((a, b, c, s3), axis=1),
        ),
        axis=1,
    )
    best = squares.argmax(axis=1)  # each row is the quaternion, times four of its own component
    return unit(rows[np.arange(len(best)), best])
