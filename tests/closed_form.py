"""What pixels of the demo scene have to be, where no edge is near."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from splatbus_renderer import scene
from splatbus_wire.messages import FrameCamera
from splatbus_wire.rotations import Quaternion, rotation_matrix

NUDGES = ((0, 0), (-0.02, -0.02), (0.02, 0.02), (-0.02, 0.02), (0.02, -0.02))
"""Where the scene looks otherwise this near, an edge is there: another answer is right too."""


def matrix(rotation: Quaternion) -> scene.Matrix:
    r = rotation_matrix(rotation)
    return (r[0:3], r[3:6], r[6:9])


def exact_pixels(
    shown: scene.Scene, camera: FrameCamera, count: int, seed: int
) -> Iterator[tuple[int, int, tuple[float, ...], float]]:
    """Of so many pixels at random those away from edges: row, column, RGBA, depth."""
    pinhole = scene.Camera(
        *(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy),
        camera.pose.position,
        matrix(camera.pose.rotation),
        camera.near,
        camera.far,
    )
    size = camera.height, camera.width
    for row, column in np.random.default_rng(seed).integers((0, 0), size, (count, 2)):
        around = [
            scene.exact_pixel(shown, pinhole, column + 0.5 + du, row + 0.5 + dv)
            for du, dv in NUDGES
        ]
        if np.ptp([color for color, _ in around], axis=0).max() < 0.02:
            yield row, column, *around[0]
