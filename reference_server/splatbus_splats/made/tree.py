"""A bonsai: a gnarled trunk, branches with twigs, and leaves in pads about the ends of these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from splatbus_splats.made.parts import (
    UPWARD,
    Floats,
    Part,
    clustered,
    directions,
    joined,
    mixed,
    noise,
    part,
    spread,
    unit,
)

TRUNK = (
    *((0.02, -0.10, 0.00, 0.135), (0.13, -0.24, 0.03, 0.098), (0.14, -0.40, -0.03, 0.088)),
    *((-0.02, -0.54, -0.07, 0.080), (-0.13, -0.68, 0.00, 0.068), (-0.05, -0.84, 0.06, 0.055)),
    *((0.07, -0.98, 0.03, 0.042), (0.05, -1.12, -0.03, 0.030), (-0.02, -1.24, 0.0, 0.018)),
)
"""Points on its axis, scene units, from the soil up, and how thick it is there."""
BRANCHES = (
    *((0.37, 0.10, 0.78), (0.44, 3.35, 0.70), (0.50, 1.60, 0.55), (0.57, 5.60, 0.50)),
    *((0.62, 2.70, 0.50), (0.68, 0.70, 0.44), (0.74, 4.20, 0.38), (0.79, 1.90, 0.36)),
    *((0.84, 5.90, 0.32), (0.89, 3.30, 0.28), (0.93, 1.00, 0.24), (0.97, 4.80, 0.20)),
)
"""Of each, where it leaves the trunk as a share of that, about which angle, and how long it is."""


class Grown(NamedTuple):
    """A tree without its leaves, and where these go."""

    limbs: list[tuple[Floats, Floats]]
    """Cones from one point to another, x, y, z and radius of each."""
    tips: list[Floats]


def bonsai(wood: int, leaves: int, random: np.random.Generator) -> Part:
    """A tree of so many Gaussians of bark, and so many leaves."""
    points = np.array(TRUNK)
    grown = Grown(list(zip(points, points[1:])), [])
    for share, angle, length in BRANCHES:
        at = share * (len(points) - 1)
        begin = points[int(at)] + at % 1.0 * np.subtract(points[int(at) + 1], points[int(at)])
        begin[3] = 0.036 - 0.026 * share
        toward = unit(np.array((np.cos(angle), -0.10 - 0.4 * share, np.sin(angle))))
        _grow(grown, begin, toward, length, random)
    grown.tips.extend(points[-1, :3] + random.normal(0.0, 0.06, (10, 3)))
    return joined((_bark(grown, wood, random), _leaves(grown, leaves, random)))


def _grow(
    grown: Grown,
    begin: Floats,
    toward: Floats,
    length: float,
    random: np.random.Generator,
    steps: int = 9,
) -> None:
    """A branch that winds outwards, with twigs to both sides of its outer part; or one of these."""
    for i in range(steps):
        toward = unit(toward + random.normal(0.0, 0.3, 3) * (1.0, 0.6, 1.0))
        end = begin + np.append(toward * length, -0.8 * begin[3]) / steps
        grown.limbs.append((begin, end))
        begin = end
        if steps < 9 or i == steps - 1:
            grown.tips.append(end[:3])
        elif i >= 2:
            for side in (-1.0, 1.0):
                across = unit(np.cross(toward, UPWARD)) * side
                out = unit(toward * 0.7 + across + random.normal((0.0, -0.35, 0.0), 0.25))
                twig = np.append(end[:3], max(0.6 * end[3], 0.004))
                _grow(grown, twig, out, length * random.uniform(0.14, 0.34), random, 4)


def _bark(grown: Grown, count: int, random: np.random.Generator) -> Part:
    begins, ends = (np.array(each) for each in zip(*grown.limbs))
    lengths = np.linalg.norm((ends - begins)[:, :3], axis=1)
    areas = np.pi * (begins + ends)[:, 3] * lengths
    weights = areas * (1.0 + 0.02 / (begins[:, 3] + 0.01))  # twigs would be too few
    which = random.choice(len(areas), count, p=weights / weights.sum())
    steps = (ends - begins)[which]
    middles = begins[which] + random.random((count, 1)) * steps
    points, radii = middles[:, :3], middles[:, 3]
    axes = unit(steps[:, :3])
    outward = unit(np.cross(axes, directions(count, random)))
    # Ridges run along: noise over direction and height, drawn out along the axis.
    ridge = noise(np.c_[outward, points], (0.28, 0.28, 0.28, 0.25, 0.16, 0.25), random)
    means = points + outward * (radii * (1.0 + 0.11 * ridge))[:, None]
    normals = outward + 0.35 * random.normal(size=(count, 3))
    sizes = np.minimum(spread(float(areas.sum()), count, 0.75), 0.5 * radii)
    albedos = mixed((0.060, 0.042, 0.030), (0.29, 0.235, 0.18), 0.45 + 0.33 * ridge)
    moss = noise(means, 0.07, random) + 6.0 * (means[:, 1] + 0.26)
    albedos = mixed(albedos, (0.085, 0.125, 0.025), moss)
    return part(random, means, normals, axes, np.outer(sizes, (1.9, 0.8, 0.2)), albedos, gloss=0.02)


def _leaves(grown: Grown, count: int, random: np.random.Generator) -> Part:
    _, out, means = clustered(count, np.array(grown.tips), (0.062, 0.034, 0.062), random)
    outward = unit(means - (0.0, -0.62, 0.0))
    normals = 0.75 * directions(count, random) + (0.0, -0.65, 0.0) + 0.35 * outward
    along = outward + directions(count, random) + (0.0, 0.4, 0.0)
    size = 0.0092 * (60_000 / max(count, 1)) ** 0.25
    young = noise(means, 0.16, random) + 0.6 * random.normal(size=count) - 0.54 * out[:, 1]
    albedos = mixed((0.042, 0.080, 0.024), (0.19, 0.235, 0.060), 0.45 + 0.24 * young)
    scales = np.array((1.15, 0.62, 0.10)) * size
    return part(random, means, normals, along, scales, albedos, gloss=0.07, thin=0.85)
