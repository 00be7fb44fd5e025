"""Views, and scenes of one or a few Gaussians, to look at."""

from __future__ import annotations

import numpy as np
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.gaussians import Gaussians
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

WIDTH, HEIGHT = 96, 64


def view_of(
    camera: Pose = IDENTITY,
    *placements: Placement,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    intrinsics: Intrinsics | None = None,
) -> View:
    """What a client asks for; an object "default" lies at the origin unless others are given."""
    objects = {each[0]: each for each in placements or [Placement("default", IDENTITY)]}
    poses = Poses(camera, objects)
    lens = intrinsics or field_of_view(*size)
    return View(poses, lens, *size, frozenset(("color", "depth")), 0)


def some(
    means: object,
    scales: object = 0.1,
    opacities: object = 0.8,
    colors: object = 0.75,
    rotations: object = (0, 0, 0, 1),
) -> Gaussians:
    """Gaussians of one colour from all sides, of arrays that are broadcast to (N, …)."""
    at = np.atleast_2d(np.array(means, np.float32))
    shades = np.broadcast_to(np.array(colors, np.float64), (len(at), 3))
    return Gaussians(
        at,
        np.array(np.broadcast_to(np.array(rotations, np.float32), (len(at), 4))),
        np.array(np.broadcast_to(np.array(scales, np.float32), (len(at), 3))),
        np.array(np.broadcast_to(np.array(opacities, np.float32), len(at))),
        ((shades - 0.5) / 0.28209479177387814)[:, None].astype(np.float32),
    )
