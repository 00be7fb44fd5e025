"""Views, and scenes of one or a few Gaussians, to look at."""

from __future__ import annotations

import numpy as np
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.gaussians import Floats, Gaussians
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
    at = np.atleast_2d(np.array(means, np.float32, order="C"))
    shades = np.broadcast_to(np.array(colors, np.float64), (len(at), 3))
    return Gaussians(
        at,
        contiguous(rotations, (len(at), 4)),
        contiguous(scales, (len(at), 3)),
        contiguous(opacities, (len(at),)),
        contiguous(((shades - 0.5) / 0.28209479177387814)[:, None], (len(at), 1, 3)),
    )


def contiguous(values: object, shape: tuple[int, ...]) -> Floats:
    """Broadcast, as `Gaussians` are: for arrays of another kind the loops are compiled again."""
    return np.array(np.broadcast_to(np.array(values, np.float32), shape), order="C")
