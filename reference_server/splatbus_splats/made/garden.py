"""A bonsai on a table in a garden, looked at as if a phone had captured it.

The table's top is about the origin, its radius 1, and y points down. Sun, shadows and sheen are in
the harmonics, as in what 3DGS trains; what is far away is coarse.
"""

from __future__ import annotations

import math

import numpy as np

from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.gaussians import COEFFICIENTS, Gaussians
from splatbus_splats.made import grounds, table, tree
from splatbus_splats.made.light import lit, sheen
from splatbus_splats.made.parts import joined, larger, turns_of
from splatbus_splats.made.views import Seen

SHARES = {
    "wood": 0.06,
    "leaves": 0.32,
    "table": 0.15,
    "pot": 0.06,
    "pebbles": 0.02,
    "paving": 0.11,
    "lawn": 0.14,
    "flowers": 0.01,
    "hedge": 0.06,
    "trees": 0.05,
}
"""Of the Gaussians; the rest is sky."""
FINE, COARSE, NEAR = 0.024, 0.22, 3.0
"""How fine shadows are within a distance of the middle, and beyond it, scene units."""
GROWTH = 1.2
"""How large the tree and its pot are on the table."""
VIEWS = tuple(
    Seen((2.7 * math.sin(turn), -1.15, -2.7 * math.cos(turn)), (0.0, -0.5, 0.0))
    for turn in (2.0 * math.pi * step / 8 - 0.34 for step in range(8))
)
"""From all around the table, the best first."""
SHARE_OPAQUE = 0.8
SPREADS = (0.0, 0.022, 0.014, 0.009)
"""Standard deviations of harmonics, by degree, beside those of sheen."""


def garden(count: int, degree: int = 3, seed: int = 1) -> Gaussians:
    """A scene of `count` Gaussians with harmonics up to a degree from 0 to 3."""
    random = np.random.default_rng(seed)
    n = {name: int(share * count) for name, share in SHARES.items()}
    parts = [
        larger(tree.bonsai(n["wood"], n["leaves"], random), GROWTH),
        table.table(n["table"], random),
        larger(table.pot(n["pot"], random), GROWTH),
        table.pebbles(n["pebbles"], 46, random),
        table.litter(n["pebbles"] // 8, random),
        grounds.paving(n["paving"], random),
        grounds.lawn(n["lawn"], random),
        grounds.flowers(n["flowers"], random),
        grounds.hedge(n["hedge"], random),
        grounds.trees(n["trees"], random),
    ]
    below = joined(parts)
    dome, colors_of_sky = grounds.sky(count - len(below.means), random)
    near = np.hypot(below.means[:, 0], below.means[:, 2]) < NEAR
    is_opaque = random.random(count) < SHARE_OPAQUE
    is_opaque[len(below.means) :] = True  # or there were holes in the sky
    opacities = np.where(is_opaque, random.beta(14.0, 1.0, count), random.beta(1.0, 5.0, count))
    colors = lit(below, opacities[: len(below.means)], np.where(near, FINE, COARSE), random)
    whole = joined((below, dome))
    coefficients = np.zeros((count, COEFFICIENTS[degree], 3))
    coefficients[:, 0] = (np.concatenate((colors, colors_of_sky)) - 0.5) / CONSTANT
    bright = np.concatenate((colors.mean(axis=1), np.zeros(len(dome.means))))
    coefficients += sheen(whole, bright, degree)
    for each in range(1, degree + 1):
        band = coefficients[:, COEFFICIENTS[each - 1] : COEFFICIENTS[each]]
        band += random.normal(0.0, SPREADS[each], band.shape)
    turns = turns_of(whole.normals, whole.along)
    order = random.permutation(count)
    arrays = (whole.means, turns, whole.scales, opacities, coefficients)
    return Gaussians(*(array.astype(np.float32)[order] for array in arrays))
