"""A round table of weathered planks, and on it a glazed pot with moss, and pebbles."""

from __future__ import annotations

import numpy as np

from splatbus_splats.made.parts import (
    UPWARD,
    Floats,
    Part,
    directions,
    disc,
    joined,
    lifted,
    mixed,
    noise,
    part,
    spread,
    turned,
)

RADIUS, PLANK, GAP = 1.0, 0.16, 0.008
GROUND = 0.74
"""Height of the ground on the y axis, scene units; the table's top is at 0."""
BODY = (
    *((GROUND, 0.36), (0.69, 0.34), (0.62, 0.16), (0.5, 0.10), (0.3, 0.085), (0.12, 0.12)),
    *((0.055, 0.30), (0.055, RADIUS), (0.01, RADIUS), (0.0, 0.99)),
)
"""Heights and radii, from the foot along the underside to the edge of the top."""
BOWL = (
    *((0.0, 0.22), (-0.02, 0.22), (-0.035, 0.26), (-0.10, 0.335), (-0.155, 0.37), (-0.16, 0.395)),
    *((-0.178, 0.40), (-0.184, 0.385), (-0.178, 0.37), (-0.13, 0.365)),
)
"""The same of the pot, from its foot to the inner edge."""


def table(count: int, random: np.random.Generator) -> Part:
    """Its top, and what it stands on."""
    body = round(0.22 * count)
    return joined((_top(count - body, random), _body(body, random)))


def _wood(points: Floats, random: np.random.Generator) -> Floats:
    """(N, 3), albedos of weathered wood whose grain runs along x, each plank's its own."""
    board = np.floor(points[:, 2] / PLANK).astype(int) % 64
    shade, shift = random.normal(0.0, 0.16, 64)[board], random.uniform(0.0, 50.0, 64)[board]
    grain = noise(np.c_[points, shift], (0.7, 1.0, 0.02, 1.0), random)
    albedos = mixed((0.115, 0.083, 0.058), (0.25, 0.195, 0.145), 0.5 + 0.2 * grain)
    return np.asarray(albedos * np.exp(shade)[:, None])


def _top(count: int, random: np.random.Generator) -> Part:
    places = disc(count, RADIUS, random)
    to_gap = random.random(count) < 0.09
    places[to_gap, 2] = np.round(places[to_gap, 2] / PLANK) * PLANK * 0.999
    across = places[:, 2] / PLANK
    in_gap = np.abs(across - np.round(across)) * PLANK < GAP / 2
    albedos = _wood(places, random)
    albedos[in_gap] *= 0.06
    fine = spread(np.pi * RADIUS**2, count)
    scales = np.tile(fine * np.array((1.9, 0.62, 0.12)), (count, 1))
    scales[in_gap] = GAP * np.array((4.0, 0.42, 0.2))
    inside = RADIUS - np.linalg.norm(places, axis=1)
    longest = 0.6 * np.maximum(inside, 0.0) + 0.3 * fine  # none stands over the edge
    scales[:, 0] = np.minimum(scales[:, 0], longest)
    normals = 0.04 * random.normal(size=(count, 3)) + UPWARD
    return part(random, places, normals, (1.0, 0.0, 0.0), scales, albedos, gloss=0.10)


def _body(count: int, random: np.random.Generator) -> Part:
    means, normals, along = turned(BODY, count, random)
    scales = spread(4.5, count) * np.array((1.4, 0.8, 0.15))
    return part(random, means, normals, along, scales, 0.8 * _wood(means, random), gloss=0.03)


def pot(count: int, random: np.random.Generator) -> Part:
    """A shallow bowl with a blue-green glaze, and moss over soil in it."""
    soil = round(0.5 * count)
    return joined((_bowl(count - soil, random), _moss(soil, random)))


def _bowl(count: int, random: np.random.Generator) -> Part:
    means, normals, along = turned(BOWL, count, random)
    runs = noise(means, (0.1, 0.05, 0.1), random) - 14.0 * (means[:, 1] + 0.08)
    albedos = mixed((0.042, 0.050, 0.062), (0.10, 0.135, 0.155), 0.5 + 0.3 * runs)
    scales = spread(0.75, count) * np.array((1.2, 0.9, 0.15))
    return part(random, means, normals, along, scales, albedos, gloss=0.22)


def _moss(count: int, random: np.random.Generator) -> Part:
    places = disc(count, 0.375, random)
    rise = 0.035 * (1.0 - np.square(places / 0.375).sum(axis=1)) + 0.01 * noise(places, 0.1, random)
    means = places + lifted(-0.155 - rise)
    normals = 0.55 * directions(count, random) + UPWARD
    patch = noise(places, 0.12, random) + 0.3 * random.normal(size=count)
    albedos = mixed((0.045, 0.075, 0.018), (0.12, 0.155, 0.036), 0.5 + 0.3 * patch)
    albedos = mixed(albedos, (0.11, 0.07, 0.042), -2.0 * patch - 1.8)
    scales = spread(0.44, count, 0.8) * np.array((1.2, 0.7, 0.3))
    return part(random, means, normals, directions(count, random), scales, albedos, thin=0.2)


def pebbles(count: int, random: np.random.Generator) -> Part:
    """Rounded ones beside the pot, each of some Gaussians."""
    stones = 26
    angle, away = random.normal(-1.9, 0.5, stones), random.normal(0.62, 0.09, stones)
    radii = 0.022 * np.exp(random.uniform(-0.7, 0.65, (stones, 1))) * (1.2, 0.62, 1.0)
    middles = np.stack((away * np.cos(angle), -0.3 * radii[:, 1], away * np.sin(angle)), axis=1)
    which = random.integers(0, stones, count)
    normals = directions(count, random)
    means = middles[which] + normals * radii[which]
    tints = mixed((0.10, 0.10, 0.105), (0.34, 0.31, 0.27), random.random(stones))
    scales = radii[which] * (1.9 * np.sqrt(stones / max(count, 1)) * np.array((0.8, 0.8, 0.2)))
    along = directions(count, random)
    return part(random, means, normals / radii[which], along, scales, tints[which], gloss=0.06)
