"""The demo scene, served, and what each pixel of a frame has to be by that frame's own words."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import splatbus_client
import splatbus_server
from splatbus_renderer import scene
from splatbus_renderer.demo import render_until, turning_time

from tests.closed_form import exact_pixels, matrix
from tests.pair.rig import Tap, served


@contextlib.contextmanager
def showing(
    width: int = 96, height: int = 54, degrees: float = 0.0, **options: Any
) -> Iterator[tuple[splatbus_server.Bus, Tap]]:
    """The demo scene, turning by so many degrees a second, at 500 images a second at most."""
    moving = {"time_range": turning_time(degrees), **options}
    with served(
        lambda stopped, bus: render_until(stopped, bus, 500.0, degrees), width, height, **moving
    ) as both:
        yield both


def wrong_pixels(
    frame: splatbus_client.FrameLease, degrees: float = 0.0, samples: int = 60
) -> tuple[int, int]:
    """How many of some pixels are not as camera, objects and time of the frame say; of how many."""
    camera, placement = frame.camera, frame.placement()
    half = math.radians(degrees * frame.time) / 2
    about_y = matrix((0.0, math.sin(half), 0.0, math.cos(half)))
    turned = scene.multiply(matrix(placement.pose.rotation), about_y)
    posed = scene.ObjectPose(placement.pose.position, turned, placement.scale)
    shown = replace(scene.default_scene(), pose=posed)
    wrong = seen = 0
    for row, column, color, depth in exact_pixels(shown, camera, samples, frame.seq):
        seen += 1
        wrong += not (
            np.allclose(frame.color[row, column], color, atol=2e-3)
            and (
                frame.depth[row, column] == depth
                or abs(frame.depth[row, column] / depth - 1) < 1e-4
            )
        )
    return wrong, seen
