"""Where a view begins, and with which lens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from splatbus_server.view import Intrinsics, field_of_view, without_size
from splatbus_wire.lens import as_high
from splatbus_wire.messages import Box
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import quaternion_from_matrix

from splatbus_splats.drawing.definition import NEAR
from splatbus_splats.files.cameras import Camera
from splatbus_splats.scene import Scene

USUAL_UP = "-y"
MIDDLE = (10.0, 90.0)
"""Percentiles of the centres on each axis between which the middle of a scene is: what is far
away, or floats before the cameras, is outside."""


def lens_of(camera: Camera, width: int, height: int) -> Intrinsics:
    """What the camera saw, from its upper to its lower edge, for images of this size."""
    return without_size(as_high(camera.lens, width, height))


def reaching(lens: Intrinsics, position: Sequence[float], bounds: Box | None) -> Intrinsics:
    """A lens that sees twice as far as a scene goes from there, and all of it from around it."""
    if bounds is None:
        return lens
    corner = np.abs(np.subtract((bounds.min, bounds.max), position)).max(axis=0)
    lengths = np.linalg.norm((2.0 * corner, 4.0 * np.subtract(bounds.max, bounds.min)), axis=1)
    return lens._replace(far=max(lens.far, float(lengths.max())))


def before(scene: Scene, width: int, height: int, up: str = USUAL_UP) -> tuple[Pose, Intrinsics]:
    """From where, looking along the horizon, the middle of a scene is in full view, and with which
    lens.

    The camera is in front of the middle, however near that is: from inside of it one would see
    Gaussians from behind, and from too near. Trained scenes have +z ahead of their first cameras as
    a rule, and y down, so that this looks as they do. The middle is widened by three standard
    deviations of what is there, as a rule; the lens has a vertical field of view of 60 degrees.

    Args:
        scene: that is looked at.
        width: pixels.
        height: pixels.
        up: the axis of the scene that is upwards in images, one of `UPWARDS`.
    """
    lens, turn = field_of_view(width, height), UPWARDS[up]
    (a, b, c), (d, e, f), (g, h, i) = turn.tolist()
    rotation = quaternion_from_matrix((a, b, c, d, e, f, g, h, i))
    objects = [each for each in scene.at(None).values() if len(each)]
    bounds = scene.bounds
    if bounds is None or not objects:
        return Pose((0.0, 0.0, 0.0), rotation), lens
    means = np.concatenate([each.means for each in objects]) @ turn.astype(np.float32)
    largest = np.concatenate([each.scales.max(axis=1) for each in objects])
    low, high = np.percentile(means, MIDDLE, axis=0).astype(np.float64)
    extents = (high - low) / 2.0 + 3.0 * float(np.median(largest))
    x, y, z = ((low + high) / 2.0).tolist()
    slopes = width / (2.0 * lens.fx), height / (2.0 * lens.fy)
    away = max(extents[0] / slopes[0], extents[1] / slopes[1], 2.0 * NEAR)
    position = tuple((turn @ (x, y, z - float(extents[2]) - away)).tolist())
    return Pose(position, rotation), reaching(lens, position, bounds)


def _turned(up: str) -> NDArray[np.float64]:
    """(3, 3), camera-to-world of a camera whose images have this axis upwards: right, down and
    ahead are its columns, right being an axis of the scene itself.
    """
    down = np.zeros(3)
    down["xyz".index(up[-1])] = 1.0 if up[0] == "-" else -1.0
    right = np.array((0.0, 1.0, 0.0) if down[0] else (1.0, 0.0, 0.0))
    return np.stack([right, down, np.cross(right, down)], axis=1)


UPWARDS = {up: _turned(up) for up in ("x", "y", "z", "-x", "-y", "-z")}
"""How a camera is turned, camera-to-world, in whose images this axis is upwards."""
