"""How long an image takes, and how far it is from the truth."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from splatbus_splats.drawing.definition import Image
from splatbus_splats.drawing.renderer import Renderer
from splatbus_splats.drawing.skips import Skip
from splatbus_splats.drawing.truth import at_pixels

from benchmarks import _shared
from benchmarks.splats.scenes import Shot

SAMPLES = 400
"""Pixels at which the truth is known."""


class Truth(NamedTuple):
    """Some pixels by their definition."""

    columns: np.ndarray
    rows: np.ndarray
    image: Image


def cost(shot: Shot, skips: Skip, rounds: int) -> list[float]:
    """Processor time of an image, quartiles, ms: of one thread, while the camera moves.

    Views follow each other; the first image is not counted.
    """
    if len(shot.views) == 1:
        skips &= ~Skip.TILES  # which would keep the whole image
    with Renderer(1, skips) as renderer:
        draws = [partial(_draw, renderer, shot, i) for i in range(rounds + 1)]
        return _shared.quartiles([_shared.processor_ms(each) for each in draws][1:])


def _draw(renderer: Renderer, shot: Shot, i: int) -> Image:
    view = shot.views[i % len(shot.views)]
    lens = (view.intrinsics, view.width, view.height)
    return renderer.draw(shot.placed(i), *lens, is_moving=True)


def image(shot: Shot, skips: Skip) -> Image:
    """Of the first view."""
    with Renderer(2, skips) as renderer:
        return Image(*(each.copy() for each in _draw(renderer, shot, 0)))


def truth(shot: Shot) -> Truth:
    """At random pixels of the first view, in double precision."""
    view = shot.views[0]
    random = np.random.default_rng(3)
    columns, rows = random.integers(0, (view.width, view.height), (SAMPLES, 2)).T
    lens = (view.intrinsics, view.width, view.height)
    return Truth(columns, rows, at_pixels(shot.placed(), *lens, columns, rows))


def error(image: Image, right: Truth) -> float:
    """Of the worst of these pixels, colour and alpha, of 1."""
    return float(np.abs(image.color[right.rows, right.columns] - right.image.color).max())
