"""Light as it is baked into trained scenes: a sun with soft shadows, the sky, and sheen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.drawing.harmonics import values
from splatbus_splats.gaussians import COEFFICIENTS
from splatbus_splats.made.parts import Floats, Part, directions, unit

TO_SUN = np.array((-0.66, -0.74, 0.13)) / np.linalg.norm((-0.66, -0.74, 0.13))
SUN, SKY, BOUNCE = (4.3, 3.75, 2.95), (0.66, 0.80, 1.02), (0.30, 0.28, 0.20)
"""Linear RGB of light: the sun's, of a whole sky, and of the ground."""
EXPOSURE = 0.76
SUN_RADIUS = 0.045
"""Of its disc, larger than the real one: soft edges of shadows."""
RAYS = 12
"""Directions from which light is looked for, to the sun, and to the whole sky."""
LOBE = (1.0, 0.75, 0.45)
"""Of sheen, by degree of the harmonics from 1 on."""


def lit(part: Part, opacities: Floats, cell: Floats, random: np.random.Generator) -> Floats:
    """(N, 3), how it looks in daylight, in sRGB.

    Args:
        part: what light falls on, and what casts shadows.
        opacities: (N,).
        cell: (N,), how fine shadows are there, scene units: few values, each a scene by itself.
        random: where rays go.
    """
    sun, sky = np.ones(len(cell)), np.ones(len(cell))
    suns = unit(TO_SUN + SUN_RADIUS * random.normal(size=(RAYS, 3)))
    skies = directions(2 * RAYS, random)
    skies = skies[skies[:, 1] < 0.15]
    covers = 2.0 * np.pi * part.scales[:, 0] * part.scales[:, 1] * opacities
    for size in np.unique(cell).tolist():
        here = np.flatnonzero(cell == size)
        shades = Shades(
            part.means[here], part.normals[here], covers[here], 2.0 * part.scales[here].max(axis=1)
        )
        sun[here] = sum(shades.light(each, size, random) for each in suns) / RAYS
        sky[here] = sum(shades.light(each, 1.6 * size, random) for each in skies) / len(skies)
    facing = part.normals @ TO_SUN
    passed = 0.75 * part.thin * np.maximum(-facing, 0.0) + 0.18 * part.thin
    direct = sun * ((1.0 - 0.35 * part.thin) * np.maximum(facing, 0.0) + passed)
    up = np.where(part.thin > 0.0, np.abs(part.normals[:, 1]), -part.normals[:, 1]) / 2.0 + 0.5
    light = np.outer(direct, SUN) + np.outer(sky * (0.35 + 0.65 * up), SKY)
    light += np.outer(sky * (1.0 - 0.7 * up), BOUNCE)
    x = EXPOSURE * part.albedos * light
    # Narkowicz's fit to the tone curve of ACES, by which the brightest is rolled off.
    rolled = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    return np.asarray(np.clip(rolled, 0.0, 1.0) ** (1.0 / 2.2))


def sheen(part: Part, sun: Floats) -> Floats:
    """(N, 16, 3), harmonics of the sun in what is glossy; the constant one is 0.

    Args:
        part: what shines.
        sun: (N,), how bright it is there.
    """
    facing = (part.normals @ TO_SUN)[:, None]
    mirrored = unit(TO_SUN - 2.0 * facing * part.normals)  # where one looks to, to see it
    lobes = np.stack(values(*mirrored.T))
    shine = np.repeat((0.0, *LOBE), np.diff((0, *COEFFICIENTS)))[:, None] * part.gloss * sun * lobes
    return np.repeat(shine.T[:, :, None], 3, axis=2)


class Shades(NamedTuple):
    """What stands in each other's light.

    Attributes:
        means: (N, 3).
        normals: (N, 3).
        covers: (N,), areas that hide something, seen along the normal.
        extents: (N,), within which a Gaussian is its own neighbour, and in nobody's shadow.
    """

    means: Floats
    normals: Floats
    covers: Floats
    extents: Floats

    def light(self, toward: Floats, cell: float, random: np.random.Generator) -> Floats:
        """(N,), how much of it comes to each past others in the same column.

        Those that are nearer to the light by more than a column is wide each take away what they
        cover of it.

        Args:
            toward: (3,), to the light.
            cell: width of the columns, scene units.
            random: where columns begin.
        """
        aside = unit(np.cross(toward, (0.31, 0.0, 0.95)))
        across = np.stack((aside, np.cross(toward, aside)), axis=1)
        columns = self.means @ across / cell
        places = np.floor(columns - columns.min(axis=0) + random.random(2)).astype(np.int64)
        column = places[:, 0] * (places[:, 1].max() + 1) + places[:, 1]
        away = -(self.means @ toward)
        away -= away.min()
        length = 2.0 * float(away.max()) + 4.0 * cell + float(self.extents.max())
        keys = column * length + away
        order: NDArray[np.int64] = np.argsort(keys)
        hidden = self.covers * (0.25 + 0.75 * np.abs(self.normals @ toward))
        sums = np.concatenate(((0.0,), np.cumsum(hidden[order])))
        ordered = keys[order]  # which is also quick to look for
        firsts = np.searchsorted(ordered, column[order] * length)
        lasts = np.maximum(np.searchsorted(ordered, ordered - cell - self.extents[order]), firsts)
        found = np.empty(len(self.means))
        found[order] = np.exp(-(sums[lasts] - sums[firsts]) / cell**2)
        return found
