"""A bonsai: a gnarled trunk, branches with twigs, and leaves in pads about the ends of these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from splatbus_splats.made.parts import (
    Floats,
    Part,
    directions,
    joined,
    mixed,
    noise,
    part,
    spread,
    unit,
)

TRUNK = (
    *((0.02, -0.10, 0.00), (0.13, -0.24, 0.03), (0.14, -0.40, -0.03), (-0.02, -0.54, -0.07)),
    *((-0.13, -0.68, 0.00), (-0.05, -0.84, 0.06), (0.07, -0.98, 0.03), (0.05, -1.12, -0.03)),
    (-0.02, -1.24, 0.0),
)
"""Points on its axis, scene units, from the soil up."""
THICKNESS = (0.135, 0.098, 0.088, 0.080, 0.068, 0.055, 0.042, 0.030, 0.018)
BRANCHES = (
    *((0.37, 0.10, 0.78), (0.44, 3.35, 0.70), (0.50, 1.60, 0.55), (0.57, 5.60, 0.50)),
    *((0.62, 2.70, 0.50), (0.68, 0.70, 0.44), (0.74, 4.20, 0.38), (0.79, 1.90, 0.36)),
    *((0.84, 5.90, 0.32), (0.89, 3.30, 0.28), (0.93, 1.00, 0.24), (0.97, 4.80, 0.20)),
)
"""Of each, where it leaves the trunk as a share of that, about which angle, and how long it is."""


class Limb(NamedTuple):
    """A piece of a branch: a cone from one point to another."""

    start: Floats
    end: Floats
    radius: float
    tip: float


class Grown(NamedTuple):
    """A tree without its leaves, and where these go."""

    limbs: list[Limb]
    tips: list[Floats]


def bonsai(wood: int, leaves: int, random: np.random.Generator) -> Part:
    """A tree of so many Gaussians of bark, and so many leaves."""
    grown = _grown(random)
    return joined((_bark(grown.limbs, wood, random), _leaves(grown.tips, leaves, random)))


def _grown(random: np.random.Generator) -> Grown:
    grown = Grown([], [])
    axis = _trunk(60)
    radii = np.interp(np.linspace(0, 1, 61), np.linspace(0, 1, len(THICKNESS)), THICKNESS)
    for i in range(60):
        grown.limbs.append(Limb(axis[i], axis[i + 1], radii[i], radii[i + 1]))
    for share, angle, length in BRANCHES:
        about = angle + random.normal(0.0, 0.15)
        out = unit(np.array((np.cos(about), -0.10 - 0.4 * share, np.sin(about))))
        reach = length * random.uniform(0.9, 1.1)
        _branch(grown, axis[round(60 * share)], out, reach, 0.036 - 0.026 * share, random)
    grown.tips.extend(axis[-1] + random.normal(0.0, 0.06, (10, 3)))
    return grown


def _branch(
    grown: Grown,
    at: Floats,
    toward: Floats,
    length: float,
    radius: float,
    random: np.random.Generator,
) -> None:
    """One that winds outwards and hangs a little, with twigs to both sides of its outer part."""
    steps = 9
    for i in range(steps):
        bent = random.normal(0.0, 0.30, 3) * (1.0, 0.5, 1.0) + (0.0, 0.05 if i > 2 else -0.05, 0.0)
        toward = unit(toward + bent)
        end = at + toward * length / steps
        thin = radius * (1.0 - 0.8 * (i + 1) / steps)
        grown.limbs.append(Limb(at, end, radius * (1.0 - 0.8 * i / steps), thin))
        at = end
        if i >= 2:
            for side in (-1.0, 1.0):
                across = unit(np.cross(toward, (0.0, side, 0.0)))
                out = unit(toward * 0.7 + across + (0.0, -0.35, 0.0) + random.normal(0, 0.25, 3))
                _twig(grown, at, out, length * random.uniform(0.14, 0.34), thin * 0.6, random)
    grown.tips.append(at)


def _twig(
    grown: Grown,
    at: Floats,
    toward: Floats,
    length: float,
    radius: float,
    random: np.random.Generator,
) -> None:
    for i in range(4):
        toward = unit(toward + random.normal(0.0, 0.35, 3))
        end = at + toward * length / 4
        grown.limbs.append(Limb(at, end, max(radius, 0.004), max(0.7 * radius, 0.003)))
        at = end
        if i:
            grown.tips.append(at)


def _trunk(pieces: int) -> Floats:
    """(pieces + 1, 3), points on a smooth line through those of the trunk (Catmull and Rom's)."""
    points = np.array(TRUNK)
    points = np.concatenate((2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]))
    t = np.linspace(0.0, len(TRUNK) - 1 - 1e-9, pieces + 1)
    i, f = t.astype(int), (t % 1.0)[:, None]
    a, b, c, d = (points[i + k] for k in range(4))
    cubic = (3 * b - a - 3 * c + d) * f**3 + (2 * a - 5 * b + 4 * c - d) * f**2 + (c - a) * f
    return np.asarray(b + cubic / 2)


def _bark(limbs: list[Limb], count: int, random: np.random.Generator) -> Part:
    starts, ends = (np.array([each[i] for each in limbs]) for i in (0, 1))
    radii, tips = (np.array([each[i] for each in limbs]) for i in (2, 3))
    lengths = np.linalg.norm(ends - starts, axis=1)
    areas = np.pi * (radii + tips) * lengths
    weights = areas * (1.0 + 0.02 / (radii + 0.01))  # twigs would be too few
    which = random.choice(len(limbs), count, p=weights / weights.sum())
    share = random.random(count)
    axes = unit(ends - starts)[which]
    aside = unit(np.cross(axes, (0.3, 0.1, 0.9)))
    angle = random.uniform(0.0, 2.0 * np.pi, count)
    outward = np.cos(angle)[:, None] * aside + np.sin(angle)[:, None] * np.cross(axes, aside)
    middle = starts[which] + share[:, None] * (ends - starts)[which]
    radius = radii[which] + share * (tips - radii)[which]
    # Ridges run along: noise over direction and height, drawn out along the axis.
    ridge = noise(np.c_[outward, middle], (0.28, 0.28, 0.28, 0.25, 0.16, 0.25), random)
    knots = noise(middle, 0.10, random)
    means = middle + outward * (radius * (1.0 + 0.11 * ridge + 0.08 * knots))[:, None]
    flare = np.maximum(0.0, (means[:, 1] + 0.22) / 0.12)  # roots hold on to the soil
    roots = np.maximum(0.0, np.cos(5.0 * angle + 1.0)) * np.minimum(flare, 1.0) ** 2
    means += outward * (0.10 * roots * (radius > 0.07))[:, None] * (1.0, 0.0, 1.0)
    normals = outward + 0.35 * random.normal(size=(count, 3))
    fine = spread(float(areas.sum()), count, 0.75)
    sizes = np.minimum(fine, 0.5 * radius)
    scales = sizes[:, None] * (1.9, 0.8, 0.2) * np.exp(random.normal(0.0, 0.4, (count, 3)))
    albedos = mixed((0.060, 0.042, 0.030), (0.29, 0.235, 0.18), 0.45 + 0.33 * ridge)
    lichen = noise(means, 0.05, random) + 0.4 * noise(means, 0.012, random)
    albedos = mixed(albedos, (0.24, 0.25, 0.20), 0.7 * (lichen - 1.2))
    moss = noise(means, 0.07, random) + 6.0 * (means[:, 1] + 0.26)
    albedos = mixed(albedos, (0.085, 0.125, 0.025), moss)
    albedos *= np.exp(random.normal(0.0, 0.16, (count, 1)))
    return part(means, normals, axes, scales, albedos, gloss=0.02)


def _leaves(tips: list[Floats], count: int, random: np.random.Generator) -> Part:
    which = random.integers(0, len(tips), count)
    out = directions(count, random) * random.random((count, 1)) ** 0.5
    center = np.array(tips)[which]
    means = center + out * (0.062, 0.034, 0.062)
    outward = unit(means - np.array((0.0, -0.62, 0.0)))
    normals = 0.75 * directions(count, random) + (0.0, -0.65, 0.0) + 0.35 * outward
    along = outward + directions(count, random) + (0.0, 0.4, 0.0)
    sizes = 0.0092 * np.exp(random.normal(0.0, 0.28, count)) * (60_000 / max(count, 1)) ** 0.25
    scales = sizes[:, None] * (1.15, 0.62, 0.10)
    scales *= np.exp(random.normal(0.0, 0.15, (count, 3)))
    young = noise(means, 0.16, random) + 0.6 * random.normal(size=count) - 0.54 * out[:, 1]
    albedos = mixed((0.042, 0.080, 0.024), (0.19, 0.235, 0.060), 0.45 + 0.24 * young)
    autumn = random.random(count) < 0.012
    albedos[autumn] = (0.42, 0.24, 0.05)
    albedos *= np.exp(random.normal(0.0, 0.2, (count, 1)))
    return part(means, normals, along, scales, albedos, gloss=0.07, thin=0.85)
