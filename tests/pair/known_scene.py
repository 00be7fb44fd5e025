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
from splatbus_server import scene
from splatbus_server.demo import render_until, turning_time
from splatbus_wire.rotations import Quaternion, rotation_matrix

from tests.pair.rig import Tap, served

NUDGES = ((0, 0), (-0.02, -0.02), (0.02, 0.02), (-0.02, 0.02), (0.02, -0.02))
"""Where the scene looks otherwise this near, an edge is there: another answer is right too."""


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


def matrix(rotation: Quaternion) -> scene.Matrix:
    r = rotation_matrix(rotation)
    return (r[0:3], r[3:6], r[6:9])


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
    pinhole = scene.Camera(
        *(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy),
        camera.pose.position,
        matrix(camera.pose.rotation),
        camera.near,
        camera.far,
    )
    rng = np.random.default_rng(frame.seq)
    wrong = seen = 0
    for row, column in rng.integers((0, 0), (camera.height, camera.width), (samples, 2)):
        around = [
            scene.exact_pixel(shown, pinhole, column + 0.5 + du, row + 0.5 + dv)
            for du, dv in NUDGES
        ]
        if np.ptp([color for color, _ in around], axis=0).max() < 0.02:
            color, depth = around[0]
            seen += 1
            wrong += not (
                np.allclose(frame.color[row, column], color, atol=2e-3)
                and (
                    frame.depth[row, column] == depth
                    or abs(frame.depth[row, column] / depth - 1) < 1e-4
                )
            )
    return wrong, seen
