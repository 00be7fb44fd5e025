"""What is about a table in a garden: paving, a lawn, flowers, a hedge, trees and the sky."""

from __future__ import annotations

import numpy as np

from splatbus_splats.made.parts import (
    UPWARD,
    Floats,
    Part,
    around,
    clustered,
    directions,
    disc,
    joined,
    lifted,
    mixed,
    noise,
    part,
    ring,
    spread,
    turned,
    unit,
)
from splatbus_splats.made.table import GROUND

PAVED, LAWN, HEDGE = 1.65, 4.4, 4.6
"""Radii to which there is stone and grass, and at which there is a hedge, scene units."""
SLABS, CLUMPS, CROWNS, PUFFS = 36, 34, 26, 30
"""Stones of the paving, clumps of flowers, trees, and clouds of leaves in a tree."""
SKY = 45.0
GREEN = (0.045, 0.075, 0.018), (0.135, 0.165, 0.045)
"""Dark and light."""


def paving(count: int, random: np.random.Generator) -> Part:
    """Slabs of irregular outlines, with moss and soil in between."""
    places = disc(count, PAVED + 0.25, random)
    shares = np.linspace(0.0, 1.0, SLABS)
    middles = around(2.4 * SLABS * shares) * (np.sqrt(shares) * (PAVED + 0.4))[:, None]
    middles += random.normal(0.0, 0.09, (SLABS, 3))
    bent = places + 0.02 * noise(places, 0.12, random)[:, None]
    away = np.linalg.norm((bent[:, None] - middles)[..., ::2], axis=2)
    nearest, second = np.partition(away, 1, axis=1)[:, :2].T
    slab = away.argmin(axis=1)
    edge = (np.linalg.norm(places, axis=1) - PAVED) / 0.12 + 0.3 * noise(places, 0.1, random)
    is_bed = random.random(count) < 0.08  # on which the slabs lie: coarse, and below them
    joint = np.maximum(1.0 - (second - nearest - 0.05) / 0.03, edge)
    means = places + lifted(GROUND + 0.018 * np.clip(joint, 0.0, 1.0) + 0.02 * is_bed)
    normals = random.normal(0.0, 0.03, (SLABS, 3))[slab] + 0.07 * directions(count, random) + UPWARD
    tints = mixed((0.12, 0.11, 0.095), (0.2, 0.18, 0.15), random.random(SLABS))[slab]
    tints *= np.exp(0.12 * noise(places, (0.1, 1.0, 0.1), random))[:, None]
    soil = mixed((0.035, 0.027, 0.018), GREEN[0], 0.5 + 0.5 * noise(places, 0.2, random))
    fine = spread(np.pi * (PAVED + 0.25) ** 2, count) * (1.0 + 1.5 * is_bed)
    scales, along = np.outer(fine, (1.2, 0.85, 0.12)), directions(count, random)
    return part(random, means, normals, along, scales, mixed(tints, soil, joint), gloss=0.03)


def lawn(count: int, random: np.random.Generator) -> Part:
    """Soil below, and blades that stand in tufts; finer near the middle."""
    below = round(0.22 * count)
    away = random.uniform(PAVED - 0.1, LAWN + 0.6, below)
    places = ring(below, random) * away[:, None]
    patch = noise(places, 0.6, random)
    fine = np.sqrt(2.0 * np.pi * (LAWN + 0.7 - PAVED) * away / max(below, 1))
    soil = part(
        random,
        places + lifted(GROUND + 0.03 + 0.02 * patch),
        0.1 * directions(below, random) + UPWARD,
        directions(below, random),
        np.outer(fine, (0.85, 0.85, 0.085)),
        mixed((0.030, 0.045, 0.013), (0.065, 0.08, 0.026), 0.5 + 0.3 * patch),
    )
    return joined((soil, _blades(count - below, random)))


def _blades(count: int, random: np.random.Generator) -> Part:
    tufts = max(count // 4, 1)
    away = PAVED - 0.06 + (LAWN - PAVED) * random.random(tufts) ** 1.7
    which, _, places = clustered(count, ring(tufts, random) * away[:, None], 0.05, random)
    far = away[which] / PAVED
    lean = unit(0.55 * directions(count, random) + UPWARD)
    heights = 0.034 * np.exp(random.normal(0.0, 0.3, count)) * (0.75 + 0.28 * far)
    means = places * (1.0, 0.0, 1.0) + lifted(GROUND + 0.03 + 0 * far) + lean * heights[:, None]
    scales = np.stack((0.62 * heights, 0.0060 * far**1.2, 0.0012 * far), axis=1)
    patch = noise(places, 0.55, random) + 0.7 * random.normal(size=count)
    normals = directions(count, random) - (0.0, 0.5, 0.0)
    return part(random, means, normals, lean, scales, mixed(*GREEN, 0.45 + 0.22 * patch), 0.04, 0.6)


def flowers(count: int, random: np.random.Generator) -> Part:
    """Clumps in front of the hedge: stalks and blossoms, each clump of one colour."""
    middles = ring(CLUMPS, random) * random.normal(HEDGE - 0.75, 0.14, (CLUMPS, 1))
    sizes = random.uniform(0.18, 0.34, (CLUMPS, 1)) * np.ones(3)
    which, out, means = clustered(count, middles + lifted([GROUND - 0.22]), sizes, random)
    means[:, 1] = np.minimum(means[:, 1], GROUND)
    kinds = ((0.46, 0.22, 0.55), (0.72, 0.66, 0.60), (0.66, 0.17, 0.27), (0.75, 0.50, 0.10))
    is_blossom = (random.random((count, 1)) < 0.42) & (out[:, 1:2] < 0.15)
    colors = np.where(is_blossom, np.array(kinds)[which % 4], mixed(*GREEN, random.random(count)))
    normals = out + (0.0, -0.6, 0.0) + 0.4 * directions(count, random)
    scales = 0.021 * np.array((1.0, 0.9, 0.5))
    return part(random, means, normals, directions(count, random), scales, colors, thin=0.4)


def hedge(count: int, random: np.random.Generator) -> Part:
    """All around, of leaves over a dark inside, with a lumpy outline."""
    inner = count // 8
    behind = HEDGE + 0.35
    at, facing, _ = turned(((-0.35, behind), (GROUND, behind)), inner, random)
    scales = spread(2.0 * np.pi * behind * 1.1, inner, 0.9) * np.array((1.0, 1.0, 0.3))
    inside = part(random, at, facing, UPWARD, scales, (0.012, 0.02, 0.008))
    return joined((inside, _leaves(count - inner, random)))


def _leaves(count: int, random: np.random.Generator) -> Part:
    at, facing, _ = turned(((-0.55, HEDGE), (GROUND, HEDGE)), count, random)
    lumps = noise(at, 0.6, random) + 0.5 * noise(at, 0.2, random)
    deep = 0.22 * random.random(count) ** 2
    means = at + facing * (0.12 * lumps - deep)[:, None]
    means[:, 1] -= np.where(at[:, 1] < -0.3, 0.12 * lumps, 0.0)
    normals = facing + (0.0, -0.4, 0.0) + 0.8 * directions(count, random)
    fresh = noise(at, 0.3, random) + 0.8 * random.normal(size=count)
    colors = mixed((0.030, 0.062, 0.018), (0.115, 0.165, 0.040), 0.45 + 0.25 * fresh - 2.5 * deep)
    scales = spread(2.0 * np.pi * HEDGE * 1.6, count, 0.75) * np.array((1.1, 0.8, 0.2))
    return part(random, means, normals, directions(count, random), scales, colors, 0.03, 0.5)


def trees(count: int, random: np.random.Generator) -> Part:
    """Crowns behind the hedge, of leaves in clouds; the farther, the hazier."""
    angles = np.linspace(0.0, 2.0 * np.pi, CROWNS) + random.normal(0.0, 0.12, CROWNS)
    away, size = random.uniform(8.5, 15.0, CROWNS), random.uniform(1.3, 2.6, CROWNS)
    crowns = around(angles) * away[:, None] + lifted(GROUND - 1.35 * size)
    owners = np.repeat(np.arange(CROWNS), PUFFS)
    puffs = directions(len(owners), random) * (0.72, 0.83, 0.72) * size[owners, None]
    radii = 0.36 * size[owners, None] * np.ones(3)
    which, out, means = clustered(count, crowns[owners] + puffs, radii, random)
    means[:, 1] = np.minimum(means[:, 1], GROUND)
    normals = out + (0.0, -0.5, 0.0) + 0.6 * directions(count, random)
    kinds = mixed((0.045, 0.075, 0.030), GREEN[1], random.random(CROWNS))[owners[which]]
    colors = mixed(kinds, (0.20, 0.25, 0.29), (away[owners[which]] - 7.0) / 30.0)
    fine = size[owners[which]] * np.sqrt(4.0 * np.pi * CROWNS / max(count, 1))
    scales = np.outer(fine, (0.7, 0.6, 0.4))
    return part(random, means, normals, directions(count, random), scales, colors, thin=0.5)


def sky(count: int, random: np.random.Generator) -> tuple[Part, Floats]:
    """A dome with thin clouds, and its colours, which no light changes: (N, 3), sRGB."""
    outward = directions(count, random)
    outward[:, 1] = np.where(outward[:, 1] > 0.12, -outward[:, 1], outward[:, 1])
    up = np.clip(-outward[:, 1], 0.0, 1.0)
    blue = mixed((0.80, 0.85, 0.88), (0.42, 0.58, 0.78), np.sqrt(up))
    clouds = noise(outward / (up[:, None] + 0.35), 0.6, random)
    colors = mixed(blue, (0.95, 0.95, 0.94), 0.3 + 0.45 * clouds)
    scales = spread(2.0 * np.pi * SKY**2 * 1.1, count, 1.0) * np.array((1.1, 1.0, 0.1))
    along = directions(count, random)
    return part(random, SKY * outward, -outward, along, scales, colors), colors
