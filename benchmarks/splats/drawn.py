"""How long an image takes, and how far it is from the truth."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from splatbus_splats.drawing.definition import Image
from splatbus_splats.drawing.renderer import Renderer
from splatbus_splats.drawing.skips import Skip
from splatbus_splats.drawing.truth import at_pixels

from benchmarks.splats.scenes import Shot

SAMPLES = 400
"""Pixels at which the truth is known."""


class Cost(NamedTuple):
    """Processor time of an image: lower quartile, median and upper quartile, ms."""

    low: float
    usual: float
    high: float


class Truth(NamedTuple):
    """Some pixels by their definition."""

    columns: np.ndarray
    rows: np.ndarray
    image: Image


def timed(work: Callable[[int], object], rounds: int) -> Cost:
    """What a call costs, of all threads of this process; it is told the number of the round."""
    work(0)
    times = []
    for i in range(rounds):
        began = time.process_time()
        work(i + 1)
        times.append((time.process_time() - began) * 1e3)
    return Cost(*(float(each) for each in np.quantile(times, (0.25, 0.5, 0.75))))


def cost(shot: Shot, skips: Skip, rounds: int) -> Cost:
    """Of the views of a shot, one after the other, by one thread; the camera moves."""
    _, _, _, views = shot
    if len(views) == 1:
        skips &= ~Skip.TILES  # which would keep the whole image
    with Renderer(1, skips) as renderer:

        def draw(i: int) -> Image:
            view = views[i % len(views)]
            lens = (view.intrinsics, view.width, view.height)
            return renderer.draw(shot.placed(i), *lens, is_moving=True)

        return timed(draw, rounds)


def image(shot: Shot, skips: Skip) -> Image:
    """Of the first view."""
    view = shot.views[0]
    with Renderer(2, skips) as renderer:
        lens = (view.intrinsics, view.width, view.height)
        drawn = renderer.draw(shot.placed(), *lens, is_moving=True)
        return Image(drawn.color.copy(), drawn.inverse.copy())


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
