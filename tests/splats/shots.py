"""Views, and scenes to look at: of one or a few Gaussians, or of as many as are wanted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.drawing.definition import Image, placed
from splatbus_splats.drawing.renderer import rendered
from splatbus_splats.drawing.skips import EXACT, Skip
from splatbus_splats.drawing.truth import truth
from splatbus_splats.gaussians import COEFFICIENTS, Floats, Gaussians
from splatbus_wire.messages import Placement
from splatbus_wire.poses import IDENTITY, Pose

WIDTH, HEIGHT = 96, 64
UNTURNED = IDENTITY.rotation


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
    rotations: object = UNTURNED,
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


def cloud(count: int, degree: int = 3, seed: int = 1) -> Gaussians:
    """A ball before a camera at the origin, and what is far away all around, as if trained."""
    random = np.random.default_rng(seed)
    out, turns = random.normal(size=(count, 3)), random.normal(size=(count, 4))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    radii = random.choice([1.2, 20.0], (count, 1), p=[0.7, 0.3])
    sizes = radii * (3.0 / count**0.5) * np.exp(random.normal(0, 0.5, (count, 3))) * (1, 1, 0.1)
    opaque = random.random(count) < 0.7
    coefficients = random.normal(0, 0.1, (count, COEFFICIENTS[degree], 3))
    coefficients[:, 0] = random.uniform(-1.5, 1.5, (count, 3))
    arrays = (
        radii * out + (radii < 2) * (0, 0.2, 4),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        sizes,
        np.where(opaque, random.beta(9, 1, count), random.beta(1, 6, count)),
        coefficients,
    )
    return Gaussians(*(each.astype(np.float32) for each in arrays))


def walls(count: int, side: int = 64) -> Floats:
    """So many behind each other from a depth of 2 on, of side² centres each."""
    x, y = np.meshgrid(np.linspace(-4, 4, side), np.linspace(-3, 3, side))
    each = [np.stack((x, y, np.full_like(x, 2.0 + i)), -1).reshape(-1, 3) for i in range(count)]
    return np.concatenate(each).astype(np.float32)


def drawn(
    view: View, objects: Mapping[str, Gaussians], skips: Skip = EXACT, threads: int = 1
) -> Image:
    lens = (view.intrinsics, view.width, view.height)
    return rendered(placed(view, objects), *lens, threads, skips)


def exact(view: View, objects: Mapping[str, Gaussians]) -> Image:
    return truth(placed(view, objects), view.intrinsics, view.width, view.height)


def alike(image: Image, other: Image) -> None:
    """They have the same bits."""
    np.testing.assert_array_equal(image.color, other.color)
    np.testing.assert_array_equal(image.inverse, other.inverse)
