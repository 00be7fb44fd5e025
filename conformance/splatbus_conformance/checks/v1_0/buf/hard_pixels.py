"""Images of pixels that are hard to compose with a plane behind or before them."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.images.painted import Painting

PLANE = 4.0
"""Depth of the plane, in scene units."""
MARGIN = 0.01
"""How near to the plane no splat lies: a depth buffer decides ties as it likes."""
STEPS = 5
"""How many neighbours each number has, in ULP."""


def around(colour: Sequence[float], width: int, height: int, *, premultiplied: bool) -> Painting:
    """Before the plane: a colour and alpha, and what lies up to STEPS ULP above each of them."""
    number = np.arange(width * height)
    steps = np.stack([number // STEPS**place % STEPS for place in range(4)], -1)
    bits = np.array(colour, np.float32).view(np.uint32) + steps.astype(np.uint32)
    image = np.minimum(bits.view(np.float32), np.float32(1.0))
    if premultiplied:
        image[:, :3] *= image[:, 3:]
    return Painting(
        image.reshape(height, width, 4), np.full((height, width), PLANE / 2, np.float32)
    )


def any_image(
    rng: np.random.Generator, width: int, height: int, *, premultiplied: bool
) -> Painting:
    """Pixels of any colour and alpha, before the plane, behind it or empty."""
    pixels = width * height
    alpha = np.where(rng.random(pixels) < 0.8, rng.random(pixels), edged(rng, pixels))
    color = edged(rng, 3 * pixels).reshape(pixels, 3)
    color = (color * alpha[:, None] if premultiplied else color).astype(np.float32)
    before = rng.random(pixels) < 0.7
    depth = np.where(
        before, rng.uniform(0.1, PLANE - MARGIN, pixels), PLANE + rng.random(pixels) + MARGIN
    )
    depth[rng.random(pixels) < 0.05] = math.inf
    image = np.concatenate([color, alpha[:, None].astype(np.float32)], -1)
    return Painting(
        image.reshape(height, width, 4), depth.astype(np.float32).reshape(height, width)
    )


def edged(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Numbers from 0 to 1, many of them near the ends."""
    edges = rng.choice([0.0, 1e-6, 1 / 255, 0.5, 1 - 2.0**-24, 1.0], count)
    return np.where(rng.random(count) < 0.6, rng.random(count), edges)
