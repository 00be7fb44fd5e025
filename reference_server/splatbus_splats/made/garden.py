"""A bonsai on a table in a garden, looked at as if a phone had captured it.

The table's top is about the origin, its radius 1, and y points down. Sun, shadows and sheen are in
the harmonics, as in what 3DGS trains; what is far away is coarse.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from splatbus_server.view import field_of_view
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import quaternion_from_matrix, rotation_matrix

from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.gaussians import COEFFICIENTS, Gaussians
from splatbus_splats.made import grounds, table, tree
from splatbus_splats.made.light import lit, sheen
from splatbus_splats.made.parts import joined, turns_of, unit

SHARES = {
    "wood": 0.06,
    "leaves": 0.32,
    "table": 0.16,
    "pot": 0.06,
    "pebbles": 0.02,
    "paving": 0.10,
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
SIZE = 960, 640
SHARE_OPAQUE = 0.8
SPREADS = (0.022, 0.014, 0.009)
"""Standard deviations of harmonics, by degree from 1 on, beside those of sheen."""


def garden(count: int, seed: int = 1) -> Gaussians:
    """A scene of `count` Gaussians with harmonics of degree 3."""
    random = np.random.default_rng(seed)
    n = {name: int(share * count) for name, share in SHARES.items()}
    planted = joined(
        (tree.bonsai(n["wood"], n["leaves"], random), table.pot(n["pot"], random)),
    )
    below = joined(
        (
            planted._replace(means=planted.means * GROWTH, scales=planted.scales * GROWTH),
            table.table(n["table"], random),
            table.pebbles(n["pebbles"], random),
            grounds.paving(n["paving"], random),
            grounds.lawn(n["lawn"], random),
            grounds.flowers(n["flowers"], random),
            grounds.hedge(n["hedge"], random),
            grounds.trees(n["trees"], random),
        )
    )
    dome, colors_of_sky = grounds.sky(count - len(below.means), random)
    near = np.hypot(below.means[:, 0], below.means[:, 2]) < NEAR
    is_opaque = random.random(count) < SHARE_OPAQUE
    is_opaque[len(below.means) :] = True  # or there were holes in the sky
    opacities = np.where(is_opaque, random.beta(14.0, 1.0, count), random.beta(1.0, 5.0, count))
    colors = lit(below, opacities[: len(below.means)], np.where(near, FINE, COARSE), random)
    whole = joined((below, dome))
    bright = np.concatenate((colors.mean(axis=1), np.zeros(len(dome.means))))
    coefficients = sheen(whole, bright)
    coefficients[:, 0] = (np.concatenate((colors, colors_of_sky)) - 0.5) / CONSTANT
    for spread, *band in zip(SPREADS, COEFFICIENTS, COEFFICIENTS[1:]):
        there = coefficients[:, slice(*band)]
        there += random.normal(0.0, spread, there.shape)
    turns = turns_of(whole.normals, whole.along)
    order = random.permutation(count)
    arrays = (whole.means, turns, whole.scales, opacities, coefficients)
    return Gaussians(*(array.astype(np.float32)[order] for array in arrays))


def poses() -> list[Pose]:
    """From where it is looked at: from all around the table, the best first."""
    found = []
    for turn in (2.0 * math.pi * step / 8 - 0.34 for step in range(8)):
        eye = 2.7 * math.sin(turn), -1.15, -2.7 * math.cos(turn)
        x, y, z = unit(np.subtract((0.0, -0.5, 0.0), eye)).tolist()
        u, _, w = unit(np.array((z, 0.0, -x))).tolist()  # to the right
        matrix = (u, y * w, x, 0.0, z * u - x * w, y, w, -y * u, z)
        found.append(Pose(eye, quaternion_from_matrix(matrix)))
    return found


def cameras() -> list[dict[str, Any]]:
    """What `cameras.json` of 3DGS has of each, with a vertical field of view of 60 degrees."""
    lens = field_of_view(*SIZE)
    return [
        {
            "id": number,
            "img_name": f"made_{number:02}",
            "width": SIZE[0],
            "height": SIZE[1],
            "position": pose.position,
            "rotation": np.reshape(rotation_matrix(pose.rotation), (3, 3)).tolist(),
            "fx": lens.fx,
            "fy": lens.fy,
        }
        for number, pose in enumerate(poses())
    ]
