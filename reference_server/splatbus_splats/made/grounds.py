"""What is about a table in a garden: paving, a lawn, flowers, a hedge, trees and the sky."""

from __future__ import annotations

import numpy as np

from splatbus_splats.made.parts import (
    Floats,
    Part,
    directions,
    disc,
    flat,
    joined,
    mixed,
    noise,
    part,
    spread,
    unit,
)
from splatbus_splats.made.table import GROUND

PAVED, LAWN, HEDGE = 1.65, 4.4, 4.6
"""Radii to which there is stone and grass, and at which there is a hedge, scene units."""
SKY = 45.0
BLADES = 4
"""Gaussians of a tuft of grass."""


def paving(count: int, random: np.random.Generator) -> Part:
    """Slabs of irregular outlines, with moss and soil in between."""
    below = count // 8
    return joined((_slabs(count - below, random), _bed(below, random)))


def _bed(count: int, random: np.random.Generator) -> Part:
    """What the slabs lie on, coarse."""
    places = disc(count, 0.0, PAVED + 0.3, random)
    scales = spread(np.pi * PAVED**2, count, 1.0) * np.array((1.0, 1.0, 0.1))
    height = GROUND + 0.035
    return part(
        flat(places, height), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), scales, (0.07, 0.06, 0.045)
    )


def _slabs(count: int, random: np.random.Generator) -> Part:
    places = disc(count, 0.0, PAVED + 0.25, random)
    seeds = _apart(disc(800, 0.0, PAVED + 0.5, random), 0.46)
    slabs = len(seeds)
    places_bent = places + 0.02 * np.stack(
        (noise(places, 0.12, random), noise(places, 0.12, random)), axis=1
    )
    away = np.linalg.norm(places_bent[:, None] - seeds[None], axis=2)
    two = np.partition(away, 1, axis=1)
    slab = away.argmin(axis=1)
    joint = np.clip(1.0 - (two[:, 1] - two[:, 0] - 0.05) / 0.03, 0.0, 1.0)
    edge = np.clip((np.hypot(*places.T) - PAVED) / 0.12 + 0.3 * noise(places, 0.1, random), 0, 1)
    joint = np.maximum(joint, edge)
    tilt = random.normal(0.0, 0.03, (slabs, 2))[slab]
    means = flat(places, GROUND + 0.018 * joint + random.normal(0.0, 0.004, slabs)[slab])
    normals = np.stack((tilt[:, 0], -np.ones(count), tilt[:, 1]), axis=1)
    normals += 0.07 * random.normal(size=(count, 3))
    tints = mixed((0.13, 0.12, 0.105), (0.24, 0.215, 0.18), random.random(slabs))
    grains = 0.10 * noise(places, 0.04, random) + 0.13 * noise(places, 0.15, random)
    albedos = tints[slab] * np.exp(grains + random.normal(0.0, 0.08, count))[:, None]
    soil = mixed(
        (0.035, 0.027, 0.018), (0.055, 0.085, 0.02), 0.5 + 0.5 * noise(places, 0.2, random)
    )
    albedos = mixed(albedos, soil, joint)
    fine = spread(np.pi * (PAVED + 0.25) ** 2, count, 0.6)
    scales = fine * np.exp(random.normal(0.0, 0.35, (count, 3))) * (1.2, 0.85, 0.12)
    return part(means, normals, directions(count, random), scales, albedos, 0.03)


def _apart(places: Floats, least: float) -> Floats:
    """Those that are no nearer to an earlier one than that."""
    kept: list[Floats] = []
    for each in places:
        if all(np.hypot(*(each - other)) >= least for other in kept):
            kept.append(each)
    return np.array(kept)


def lawn(count: int, random: np.random.Generator) -> Part:
    """Soil below, and blades that stand in tufts, finer near the middle."""
    below = round(0.22 * count)
    radius = random.uniform(PAVED - 0.1, LAWN + 0.6, below)  # the finer the nearer
    angle = random.uniform(0.0, 2.0 * np.pi, below)
    places = radius[:, None] * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    patch = noise(places, 0.6, random)
    albedos = mixed((0.030, 0.045, 0.013), (0.065, 0.08, 0.026), 0.5 + 0.3 * patch)
    albedos *= np.exp(random.normal(0.0, 0.3, (below, 1)))
    fine = 0.85 * np.sqrt(2.0 * np.pi * radius * (LAWN + 0.7 - PAVED) / below)
    scales = fine[:, None] * np.exp(random.normal(0.0, 0.3, (below, 3)))
    soil = part(
        flat(places, GROUND + 0.03 + 0.02 * patch),
        (0.0, -1.0, 0.0) + 0.1 * directions(below, random),
        directions(below, random),
        scales * (1.0, 1.0, 0.1),
        albedos,
    )
    return joined((soil, _blades(count - below, random)))


def _blades(count: int, random: np.random.Generator) -> Part:
    tufts = max(count // BLADES, 1)
    radius = PAVED - 0.06 + (LAWN - PAVED) * random.random(tufts) ** 1.7
    angle = random.uniform(0.0, 2.0 * np.pi, tufts)
    centers = np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
    which = random.integers(0, tufts, count)
    far = radius[which] / PAVED
    places = centers[which] + random.normal(0.0, 0.016, (count, 2)) * far[:, None]
    lean = unit(directions(count, random) * (0.55, 0.0, 0.55) + (0.0, -1.0, 0.0))
    height = 0.034 * np.exp(random.normal(0.0, 0.3, count)) * (0.75 + 0.28 * far)
    means = flat(places, GROUND + 0.03) + lean * height[:, None]
    scales = np.stack((0.62 * height, 0.0060 * far**1.2, 0.0012 * far), axis=1)
    scales *= np.exp(random.normal(0.0, 0.2, (count, 3)))
    patch = noise(places, 0.55, random) + 0.7 * random.normal(size=count)
    albedos = mixed((0.045, 0.075, 0.018), (0.135, 0.165, 0.045), 0.45 + 0.22 * patch)
    dry = random.random(count) < 0.06
    albedos[dry] = (0.30, 0.25, 0.12)
    normals = directions(count, random) * (1.0, 0.35, 1.0) + (0.0, -0.5, 0.0)
    return part(means, normals, lean, scales, albedos, 0.04, 0.6)


def flowers(count: int, random: np.random.Generator) -> Part:
    """Clumps in front of the hedge: stalks and blossoms, each clump of one colour."""
    clumps = 34
    angle = random.uniform(0.0, 2.0 * np.pi, clumps)
    middle = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    middle *= random.normal(HEDGE - 0.75, 0.14, (clumps, 1))
    colors = np.array(
        ((0.46, 0.22, 0.55), (0.72, 0.66, 0.60), (0.66, 0.17, 0.27), (0.75, 0.50, 0.10))
    )[random.integers(0, 4, clumps)]
    which = random.integers(0, clumps, count)
    size = random.uniform(0.18, 0.34, clumps)[which, None]
    out = directions(count, random) * random.random((count, 1)) ** 0.4
    means = flat(middle[which], GROUND - 0.22) + out * size * (1.0, 1.1, 1.0)
    means[:, 1] = np.minimum(means[:, 1], GROUND)
    is_blossom = (random.random(count) < 0.42) & (out[:, 1] < 0.15)
    green = mixed((0.05, 0.10, 0.025), (0.13, 0.18, 0.05), random.random(count))
    albedos = np.where(is_blossom[:, None], colors[which], green)
    albedos *= np.exp(random.normal(0.0, 0.2, (count, 1)))
    normals = out + (0.0, -0.6, 0.0) + 0.4 * directions(count, random)
    scales = 0.021 * np.exp(random.normal(0.0, 0.3, (count, 3))) * (1.0, 0.9, 0.5)
    return part(means, normals, directions(count, random), scales, albedos, 0.0, 0.4)


def hedge(count: int, random: np.random.Generator) -> Part:
    """All around, of leaves over a dark inside, with a lumpy outline."""
    inner = count // 8
    angle = random.uniform(0.0, 2.0 * np.pi, inner)
    heights = random.uniform(-0.35, GROUND, inner)
    ring = HEDGE + 0.35
    means = np.stack((ring * np.cos(angle), heights, ring * np.sin(angle)), axis=1)
    scales = spread(2.0 * np.pi * ring * 1.1, inner, 0.9) * np.array((1.0, 1.0, 0.3))
    inside = part(means, -means * (1.0, 0.0, 1.0), (0.0, 1.0, 0.0), scales, (0.012, 0.02, 0.008))
    return joined((inside, _leaves(count - inner, random)))


def _leaves(count: int, random: np.random.Generator) -> Part:
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    ring = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    top = -0.55 - 0.16 * noise(ring, 0.22, random) - 0.08 * noise(ring, 0.05, random)
    share = random.random(count)
    heights = GROUND + share * (top - GROUND)
    around = np.c_[ring * HEDGE, heights]
    bulge = 0.16 * noise(around, 0.45, random) + 0.06 * noise(around, 0.14, random)
    crown = 0.55 * np.clip((share - 0.82) / 0.18, 0.0, 1.0) ** 2
    inside = 0.22 * random.random(count) ** 2
    places = ring * (HEDGE - bulge + crown + inside)[:, None]
    means = flat(places, heights + 0.05 * random.normal(size=count) * (share > 0.9))
    normals = -flat(ring, 0.0) + (0.0, -0.4, 0.0) + 0.8 * directions(count, random)
    fresh = noise(around, 0.3, random) + 0.8 * random.normal(size=count)
    albedos = mixed((0.030, 0.062, 0.018), (0.115, 0.165, 0.040), 0.45 + 0.25 * fresh)
    albedos *= np.exp(random.normal(0.0, 0.25, (count, 1))) * (1.0 - 2.5 * inside)[:, None]
    fine = spread(2.0 * np.pi * HEDGE * 1.6, count, 0.75)
    scales = fine * np.exp(random.normal(0.0, 0.35, (count, 3))) * (1.1, 0.8, 0.2)
    return part(means, normals, directions(count, random), scales, albedos, 0.03, 0.5)


def trees(count: int, random: np.random.Generator) -> Part:
    """Crowns behind the hedge, of leaves in clouds, and trunks."""
    crowns = 26
    angle = np.linspace(0.0, 2.0 * np.pi, crowns, endpoint=False) + random.normal(0, 0.12, crowns)
    away = random.uniform(8.5, 15.0, crowns)
    size = random.uniform(1.3, 2.6, crowns)
    middle = np.stack((away * np.cos(angle), GROUND - size * 1.35, away * np.sin(angle)), axis=1)
    weights = (size / away) ** 2
    which = random.choice(crowns, count, p=weights / weights.sum())
    puffs = 30
    puff = directions(crowns * puffs, random) * (1.0, 1.15, 1.0) * 0.72
    chosen = which * puffs + random.integers(0, puffs, count)
    out = directions(count, random)
    means = middle[which] + size[which, None] * (puff[chosen] + 0.36 * out)
    means[:, 1] = np.minimum(means[:, 1], GROUND)
    normals = out + (0.0, -0.5, 0.0) + 0.6 * directions(count, random)
    kinds = mixed((0.045, 0.075, 0.030), (0.13, 0.165, 0.05), random.random(crowns))
    albedos = kinds[which] * np.exp(random.normal(0.0, 0.3, (count, 1)))
    haze = np.clip((away[which] - 7.0) / 30.0, 0.0, 1.0)
    albedos = mixed(albedos, (0.20, 0.25, 0.29), haze)
    fine = 1.5 * size[which] * np.sqrt(4.0 * np.pi / (count * weights[which] / weights.sum()))
    scales = 0.45 * fine[:, None] * np.exp(random.normal(0.0, 0.4, (count, 3))) * (1.0, 0.85, 0.6)
    return part(means, normals, directions(count, random), scales, albedos, 0.0, 0.5)


def sky(count: int, random: np.random.Generator) -> tuple[Part, Floats]:
    """A dome with thin clouds, and its colours, which no light changes: (N, 3), sRGB."""
    outward = directions(count, random)
    outward[:, 1] = np.where(outward[:, 1] > 0.12, -outward[:, 1], outward[:, 1])
    outward = unit(outward)
    up = np.clip(-outward[:, 1], 0.0, 1.0)
    blue = mixed((0.80, 0.85, 0.88), (0.42, 0.58, 0.78), np.sqrt(up))
    stretched = outward / (up[:, None] + 0.35)
    clouds = noise(stretched, (0.6, 0.6, 0.6), random) + 0.5 * noise(stretched, 0.22, random)
    colors = mixed(blue, (0.95, 0.95, 0.94), 0.3 + 0.45 * clouds)
    colors += random.normal(0.0, 0.008, (count, 3))
    fine = spread(2.0 * np.pi * SKY**2 * 1.1, count, 1.0)
    scales = fine * np.exp(random.normal(0.0, 0.25, (count, 3))) * (1.1, 1.0, 0.1)
    dome = part(SKY * outward, -outward, directions(count, random), scales, colors)
    return dome, colors
