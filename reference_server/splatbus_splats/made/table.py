"""A round table of weathered planks, and on it a glazed pot with moss, and what fell down."""

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

RADIUS, THICKNESS = 1.0, 0.055
PLANK, GAP = 0.16, 0.008
GROUND = 0.74
"""Height of the ground on the y axis, scene units; the table's top is at 0."""
POT = (
    *((0.0, 0.22), (0.02, 0.22), (0.035, 0.26), (0.10, 0.335), (0.155, 0.37), (0.16, 0.395)),
    *((0.178, 0.40), (0.184, 0.385), (0.178, 0.37), (0.13, 0.365)),
)
"""Heights above the table and radii, from the foot to the inner edge."""


def table(count: int, random: np.random.Generator) -> Part:
    """Its top, its edge, and a foot."""
    edge, foot, below = round(0.13 * count), round(0.05 * count), round(0.05 * count)
    return joined(
        (
            _top(count - edge - foot - below, random),
            _edge(edge, random),
            _foot(foot, random),
            _below(below, random),
        )
    )


def _wood(points: Floats, board: Floats, random: np.random.Generator) -> Floats:
    """(N, 3), albedos of weathered wood whose grain runs along x."""
    shade = random.normal(0.0, 0.16, 64)[board.astype(int) % 64]
    shift = random.uniform(0.0, 50.0, 64)[board.astype(int) % 64]
    moved = points + np.stack((shift, 0 * shift, shift), axis=1)
    grain = noise(moved, (0.7, 1.0, 0.022), random) + 0.6 * noise(moved, (0.35, 1, 0.009), random)
    stains = noise(points, 0.22, random)
    albedos = mixed((0.115, 0.083, 0.058), (0.25, 0.195, 0.145), 0.5 + 0.17 * grain)
    albedos = mixed(albedos, (0.085, 0.075, 0.06), 0.25 * (stains - 0.4))
    return np.asarray(albedos * np.exp(shade + random.normal(0.0, 0.05, len(points)))[:, None])


def _top(count: int, random: np.random.Generator) -> Part:
    places = disc(count, 0.0, RADIUS, random)
    is_gap = random.random(count) < 0.09
    places[is_gap, 1] = np.round(places[is_gap, 1] / PLANK) * PLANK
    places[np.hypot(*places.T) > RADIUS] *= 0.97
    board = np.floor(places[:, 1] / PLANK)
    across = places[:, 1] / PLANK - board - 0.5
    from_gap = (0.5 - np.abs(across)) * PLANK
    in_gap = from_gap < GAP / 2
    worn = np.exp(-from_gap / 0.006)
    means = flat(places, 0.003 * worn - 0.004 * in_gap + 0.0015 * noise(places, 0.15, random))
    normals = np.tile((0.0, -1.0, 0.0), (count, 1))
    normals[:, 2] += 0.5 * worn * np.sign(across) + 0.04 * random.normal(size=count)
    normals[:, 0] += 0.04 * random.normal(size=count)
    albedos = _wood(means, board, random)
    albedos[in_gap] *= 0.06
    fine = spread(np.pi * RADIUS**2, count, 0.58)
    scales = fine * np.exp(random.normal(0.0, 0.35, (count, 3))) * (1.9, 0.62, 0.12)
    scales[in_gap] = GAP * np.array((4.0, 0.42, 0.2))
    inside = np.sqrt(np.maximum(RADIUS**2 - places[:, 1] ** 2, 0.0)) - np.abs(places[:, 0])
    inside = np.maximum(inside, 0.0)  # of the edge, over which no plank stands
    scales[:, 0] = np.minimum(scales[:, 0], 0.4 * inside + 0.5 * fine)
    return part(means, normals, (1.0, 0.0, 0.0), scales, albedos, gloss=0.10)


def _edge(count: int, random: np.random.Generator) -> Part:
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    height = random.uniform(0.0, THICKNESS, count)
    outward = np.stack((np.cos(angle), np.zeros(count), np.sin(angle)), axis=1)
    round_off = 0.012 * np.exp(-height / 0.010)
    means = outward * (RADIUS - round_off)[:, None] + np.c_[0 * height, height, 0 * height]
    albedos = _wood(means, np.floor(means[:, 2] / PLANK), random) * 0.9
    normals = outward - 0.7 * np.exp(-height / 0.006)[:, None] * (0.0, 1.0, 0.0)
    scales = spread(2 * np.pi * THICKNESS, count) * np.exp(random.normal(0.0, 0.3, (count, 3)))
    along = np.cross(outward, (0.0, 1.0, 0.0))
    return part(means, normals, along, scales * (1.4, 0.8, 0.15), albedos, gloss=0.05)


def _below(count: int, random: np.random.Generator) -> Part:
    """Its dark underside, which also closes what the top leaves open."""
    places = disc(count, 0.0, RADIUS - 0.08, random)
    height = np.where(random.random(count) < 0.5, 0.02, THICKNESS)
    fine = spread(np.pi * RADIUS**2, count // 2, 0.9)
    inside = np.minimum(fine, 0.4 * (RADIUS - np.hypot(*places.T)))
    scales = inside[:, None] * (1.0, 1.0, 0.05)
    normals = np.where(height > 0.03, 1.0, -1.0)[:, None] * (0.0, 1.0, 0.0)
    return part(flat(places, height), normals, (1.0, 0.0, 0.0), scales, (0.075, 0.06, 0.045))


def _foot(count: int, random: np.random.Generator) -> Part:
    heights = np.array((THICKNESS, 0.12, 0.3, 0.5, 0.62, 0.69, GROUND))
    radii = np.array((0.30, 0.12, 0.085, 0.10, 0.16, 0.34, 0.36))
    at = random.uniform(THICKNESS, GROUND, count)
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    outward = np.stack((np.cos(angle), np.zeros(count), np.sin(angle)), axis=1)
    means = outward * np.interp(at, heights, radii)[:, None] + np.c_[0 * at, at, 0 * at]
    albedos = 0.8 * mixed(
        (0.12, 0.09, 0.065),
        (0.26, 0.21, 0.165),
        0.5 + 0.3 * noise(means, (0.02, 0.3, 0.02), random),
    )
    scales = spread(0.8, count) * np.exp(random.normal(0.0, 0.3, (count, 3))) * (0.9, 0.7, 0.15)
    return part(means, outward, (0.0, 1.0, 0.0), scales, albedos, gloss=0.03)


def pot(count: int, random: np.random.Generator) -> Part:
    """A shallow bowl with a blue-green glaze, and moss over soil in it."""
    soil = round(0.5 * count)
    return joined((_bowl(count - soil, random), _moss(soil, random)))


def _bowl(count: int, random: np.random.Generator) -> Part:
    profile = np.array(POT)
    lengths = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    ends = np.concatenate(((0.0,), np.cumsum(lengths)))
    at = random.uniform(0.0, ends[-1], count)
    height, radius = (np.interp(at, ends, profile[:, i]) for i in (0, 1))
    ahead, behind = (np.clip(at + aside, 0, ends[-1]) for aside in (0.008, -0.008))
    rise, grow = (
        np.interp(ahead, ends, profile[:, i]) - np.interp(behind, ends, profile[:, i])
        for i in (0, 1)
    )
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    outward = np.stack((np.cos(angle), np.zeros(count), np.sin(angle)), axis=1)
    means = outward * radius[:, None] - height[:, None] * (0.0, 1.0, 0.0)
    normals = unit(outward * rise[:, None] + grow[:, None] * (0.0, 1.0, 0.0))
    runs = noise(np.c_[angle * 0.3, height], (0.025, 0.12), random) + 14.0 * (height - 0.08)
    albedos = mixed((0.042, 0.050, 0.062), (0.10, 0.135, 0.155), 0.5 + 0.3 * runs)
    speckled = random.random(count) < 0.04
    albedos[speckled] *= 1.7
    bare = height < 0.045 + 0.008 * noise(np.c_[np.cos(angle), np.sin(angle)], 0.2, random)
    albedos[bare] = (0.17, 0.095, 0.06)
    albedos *= np.exp(random.normal(0.0, 0.05, (count, 1)))
    scales = (
        spread(0.75, count, 0.62) * np.exp(random.normal(0.0, 0.3, (count, 3))) * (1.2, 0.9, 0.15)
    )
    along = np.cross(outward, (0.0, 1.0, 0.0))
    return part(means, normals, along, scales, albedos, gloss=0.22)


def _moss(count: int, random: np.random.Generator) -> Part:
    places = disc(count, 0.0, 0.375, random)
    lumps = noise(places, 0.09, random)
    rise = 0.035 * (1.0 - (np.hypot(*places.T) / 0.375) ** 2) + 0.010 * lumps
    means = flat(places, -0.155 - rise - 0.006 * np.abs(random.normal(size=count)))
    normals = (0.0, -1.0, 0.0) + 0.55 * directions(count, random)
    patch = noise(places, 0.12, random) + 0.3 * random.normal(size=count)
    albedos = mixed((0.045, 0.075, 0.018), (0.12, 0.155, 0.036), 0.5 + 0.3 * patch)
    albedos = mixed(albedos, (0.11, 0.07, 0.042), 2.0 * (-patch - 0.9))
    albedos *= np.exp(random.normal(0.0, 0.25, (count, 1)))
    scales = spread(0.44, count, 0.8) * np.exp(random.normal(0.0, 0.3, (count, 3)))
    along = directions(count, random)
    return part(means, normals, along, scales * (1.2, 0.7, 0.3), albedos, thin=0.2)


def pebbles(count: int, stones: int, random: np.random.Generator) -> Part:
    """Rounded ones beside the pot and in it, each of some Gaussians."""
    which = random.integers(0, stones, count)
    radius = 0.022 * np.exp(np.clip(random.normal(0.0, 0.4, stones), -0.7, 0.65))
    is_in = random.random(stones) < 0.45
    angle, away = random.normal(-1.9, 0.5, stones), random.normal(0.62, 0.09, stones)
    away[is_in] = random.uniform(0.16, 0.33, is_in.sum())
    angle[is_in] = random.uniform(0.0, 2.0 * np.pi, is_in.sum())
    base = np.where(is_in, -0.165, -0.3 * radius)
    middle = np.stack((away * np.cos(angle), base, away * np.sin(angle)), axis=1)
    normals = directions(count, random)
    shape = np.exp(random.normal(0.0, 0.2, (stones, 3))) * (1.2, 0.62, 1.0)
    means = middle[which] + normals * shape[which] * radius[which, None]
    tint = mixed((0.10, 0.10, 0.105), (0.34, 0.31, 0.27), random.random(stones))
    albedos = (
        tint[which]
        * np.exp(0.22 * noise(means, 0.01, random) + random.normal(0, 0.1, count))[:, None]
    )
    sizes = 1.7 * radius[which] * np.sqrt(stones / max(count, 1))
    scales = sizes[:, None] * np.exp(random.normal(0.0, 0.25, (count, 3))) * (1.1, 0.9, 0.2)
    return part(means, normals / shape[which], directions(count, random), scales, albedos, 0.06)


def litter(count: int, random: np.random.Generator) -> Part:
    """Leaves that fell on the table and the ground, most of them below the tree."""
    places = random.normal((0.15, -0.05), 0.62, (count, 2))
    on_table = np.hypot(*places.T) < RADIUS - 0.01
    outside = np.hypot(*places.T) > 0.45
    places = places[outside]
    means = flat(places, np.where(on_table[outside], -0.005, GROUND - 0.012))
    count = len(means)
    normals = (0.0, -1.0, 0.0) + 0.25 * directions(count, random)
    albedos = mixed((0.08, 0.12, 0.03), (0.36, 0.20, 0.05), random.random(count))
    scales = 0.0085 * np.exp(random.normal(0.0, 0.2, (count, 3))) * (1.25, 0.7, 0.12)
    return part(means, normals, directions(count, random), scales, albedos, 0.05, 0.3)
