"""Scenes to draw, each with the views of it that follow each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View, field_of_view
from splatbus_splats.drawing.definition import Placed, placed
from splatbus_splats.drawing.harmonics import CONSTANT
from splatbus_splats.gaussians import Gaussians, along_curve
from splatbus_splats.made import garden, poses
from splatbus_wire.messages import DEFAULT_OBJECT, Placement
from splatbus_wire.poses import IDENTITY, Pose

SIZE = (640, 480)
BOTH = frozenset({"color", "depth"})


FRONT = poses()[0]


@dataclass(frozen=True)
class Shot:
    """A scene, and from where it is seen."""

    name: str
    objects: dict[str, Gaussians]
    views: tuple[View, ...]

    def placed(self, i: int = 0) -> list[Placed]:
        """What a renderer is given for the view of this number."""
        return placed(self.views[i % len(self.views)], self.objects)


def view(
    pose: Pose = FRONT,
    *placements: Placement,
    size: tuple[int, int] = SIZE,
    lens: Intrinsics | None = None,
) -> View:
    """What a client asks for; an object `default` lies at the origin."""
    objects = {each[0]: each for each in (Placement(DEFAULT_OBJECT, IDENTITY), *placements)}
    return View(Poses(pose, objects), lens or field_of_view(*size), *size, BOTH, 0)


def front(count: int, size: tuple[int, int] = SIZE) -> Shot:
    """A bonsai on a table in a garden, from before it."""
    scene = {DEFAULT_OBJECT: along_curve(garden(count))}
    return Shot(f"front, {count:,}", scene, (view(size=size),))


def detail() -> Shot:
    """A long lens, in whose image is a hundredth of a large scene."""
    lens = field_of_view(*SIZE, vertical_degrees=8.0)
    scene = {DEFAULT_OBJECT: along_curve(garden(1_000_000))}
    return Shot("detail", scene, (view(lens=lens),))


def walls(count: int) -> Shot:
    """One behind the other: the deeper, the more is hidden."""
    random = np.random.default_rng(1)
    x, y = np.meshgrid(np.linspace(-3.0, 3.0, 60), np.linspace(-3.0, 3.0, 60))
    wall = np.stack((x, y, np.full_like(x, 2.0)), axis=-1).reshape(-1, 3)
    depths = [wall * (1.0 + 0.25 * i) + random.normal(0.0, 0.03, wall.shape) for i in range(count)]
    sizes = np.repeat(0.08 * (1.0 + 0.25 * np.arange(count)), len(wall))
    scene = _alike(np.concatenate(depths), sizes, random)
    return Shot(f"walls, {count}", {DEFAULT_OBJECT: scene}, (view(IDENTITY),))


def statue() -> Shot:
    """A small thing that is moved over the table."""
    random = np.random.default_rng(2)
    thing = _alike(random.normal(0.0, 0.12, (5_000, 3)), np.full(5_000, 0.03), random)
    scene = {DEFAULT_OBJECT: along_curve(garden(100_000)), "statue": thing}
    views = tuple(
        view(FRONT, Placement("statue", IDENTITY._replace(position=(-0.4 + 0.1 * i, -0.3, -0.7))))
        for i in range(8)
    )
    return Shot("statue", scene, views)


def afar() -> Shot:
    """Everything smaller than a pixel."""
    scene = {DEFAULT_OBJECT: along_curve(garden(1_000_000))}
    pose = IDENTITY._replace(position=(0.0, 0.0, -400.0))
    return Shot("afar", scene, (view(pose, lens=field_of_view(*SIZE)._replace(far=1000.0)),))


def shots() -> Iterator[Shot]:
    """Those whose skips are looked at one by one."""
    yield front(10_000)
    yield front(100_000)
    yield front(1_000_000)
    yield detail()
    yield walls(60)
    yield statue()
    yield afar()


def _alike(
    means: NDArray[np.float64], sizes: NDArray[np.float64], random: np.random.Generator
) -> Gaussians:
    """Round ones of random colours."""
    count = len(means)
    colors = random.uniform(-0.5, 0.5, (count, 1, 3)) / CONSTANT
    turns = np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))
    arrays = (means, turns, np.repeat(sizes[:, None], 3, axis=1), random.beta(9.0, 1.0, count))
    return along_curve(Gaussians(*(np.asarray(a, np.float32) for a in (*arrays, colors))))
