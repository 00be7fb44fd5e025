"""Gaussians that live in time: files of Spacetime Gaussians (Li et al. 2024), the lite model.

Beside what a vertex of 3DGS has: trbf_center, at which moment t of the clip, which runs from 0 to
1, it is most opaque, and trbf_scale, the logarithm of how long; motion_0 to motion_8, how its mean
goes with t, three numbers for each power; omega_0 to omega_3, how its quaternion w, x, y, z does.
Of the powers the higher ones may be missing, or all, and the quaternion's four numbers too.

With dt = t - center: opacity exp(-(dt / exp(scale))²), mean + m₁dt + m₂dt² + m₃dt³, and
(rotation + omega dt) normalised.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.messages import Box

from splatbus_splats.drawing.definition import LEAST_ALPHA
from splatbus_splats.gaussians import Floats, Gaussians

TIME = ("trbf_center", "trbf_scale")
OMEGA = ("omega_1", "omega_2", "omega_3", "omega_0")
"""In the order x, y, z, w."""


class Members(NamedTuple):
    """Which of them a file has."""

    powers: int
    """Of the time in its means, 0 to 3."""
    turns: bool


@dataclass(frozen=True, eq=False)
class Motion:
    """How N Gaussians change over a clip, whose time runs from 0 to 1; all float32.

    Attributes:
        centers: (N,), when each is most opaque, as it is in its `Gaussians`.
        lives: (N,), after which time its opacity is 1/e of that; infinite where it stays.
        paths: (N, 3, 3), what to add to the mean for each power of the time since then, 1 to 3.
        turns: (N, 4), what to add to the unit quaternion x, y, z, w for that time.
    """

    centers: Floats
    lives: Floats
    paths: Floats
    turns: Floats

    def __getitem__(self, which: Any) -> Motion:
        return Motion(self.centers[which], self.lives[which], self.paths[which], self.turns[which])


def members(path: Path, names: Collection[str]) -> Members | None:
    """Which of the properties a file has; None where its Gaussians do not live in time.

    Raises:
        ValueError: some are there without the others that they need.
    """
    if not any(name in names for name in TIME):
        return None
    powers, rest = divmod(sum(name.startswith("motion_") for name in names), 3)
    turns = any(name.startswith("omega_") for name in names)
    needed = [*TIME, *_paths(powers + (rest > 0)), *(OMEGA if turns else ())]
    if missing := [name for name in needed if name not in names]:
        raise ValueError(
            f"{path}: Gaussians in time, whose vertices have no property {', '.join(missing)}"
        )
    if powers > 3:
        raise ValueError(f"{path}: {3 * powers} properties motion_*, where there are 0, 3, 6, 9")
    if "f_dc_3" in names:
        raise ValueError(
            f"{path}: f_dc_3 and on are for a network that is not in the file: of Spacetime"
            " Gaussians the lite model can be shown, which has three of f_dc_*"
        )
    return Members(powers, turns)


def needed(which: Members) -> list[str]:
    """The names of the properties that are read."""
    return [*TIME, *_paths(which.powers), *(OMEGA if which.turns else ())]


def decoded(rows: NDArray[Any], which: Members) -> Motion:
    """What some vertices say of time, not yet looked at, for quaternions of the norm they have."""
    paths = np.zeros((len(rows), 3, 3), np.float32)
    for i, name in enumerate(_paths(which.powers)):
        paths[:, i // 3, i % 3] = rows[name]
    turns = np.zeros((len(rows), 4), np.float32)
    for i, name in enumerate(OMEGA if which.turns else ()):
        turns[:, i] = rows[name]
    return Motion(
        rows["trbf_center"].astype(np.float32),
        np.exp(rows["trbf_scale"].astype(np.float32)),
        paths,
        turns,
    )


def empty(count: int) -> Motion:
    """Room for the motion of as many Gaussians, with whatever lies there."""
    shapes = ((count,), (count,), (count, 3, 3), (count, 4))
    return Motion(*(np.empty(shape, np.float32) for shape in shapes))


def reach(gaussians: Gaussians, motion: Motion) -> NDArray[np.float64]:
    """(N,), how far from the origin of an axis each may come over the clip, at most."""
    centers = motion.centers.astype(np.float64)
    longest = np.maximum(np.abs(centers), np.abs(1.0 - centers))
    powers = np.stack((longest, longest**2, longest**3), axis=1)
    moved = (np.abs(motion.paths) * powers[:, :, None]).sum(axis=1)
    return np.asarray((np.abs(gaussians.means) + moved).max(axis=1, initial=0.0))


@np.errstate(over="ignore", under="ignore", divide="ignore")
def moved(gaussians: Gaussians, motion: Motion, time: float) -> Gaussians:
    """Those that can be seen at a moment of the clip, from 0 to 1, as they are then.

    What is fainter than any pixel shows is not among them.
    """
    since = np.float32(time) - motion.centers
    opacities = gaussians.opacities * np.exp(-np.square(since / motion.lives))
    which = np.flatnonzero(opacities >= LEAST_ALPHA)
    turns = gaussians.rotations[which] + motion.turns[which].astype(np.float64) * since[which, None]
    norms = np.linalg.norm(turns, axis=1)
    if not norms.all():
        which, turns, norms = which[norms > 0.0], turns[norms > 0.0], norms[norms > 0.0]
    first, second, third = (motion.paths[which, power] for power in range(3))
    dt = since[which, None]
    return Gaussians(
        gaussians.means[which] + ((third * dt + second) * dt + first) * dt,
        (turns / norms[:, None]).astype(np.float32),
        gaussians.scales[which],
        opacities[which],
        gaussians.coefficients[which],
    )


@np.errstate(all="ignore")
def reached(gaussians: Gaussians, motion: Motion) -> Box | None:
    """The box of the centres over the whole clip, each while it can be seen; None if none can be.

    A path is a cubic on each axis: its ends, and where it turns round, are its extremes.
    """
    faintness = np.log(255.0 * gaussians.opacities.astype(np.float64))
    visible = motion.lives * np.sqrt(faintness)  # not a number where it never is
    first = np.maximum(-visible, -motion.centers.astype(np.float64))
    last = np.minimum(visible, 1.0 - motion.centers.astype(np.float64))
    which = np.flatnonzero(first <= last)
    if not len(which):
        return None
    first, last = first[which, None], last[which, None]
    means = gaussians.means[which].astype(np.float64)
    c, b, a = (motion.paths[which, power].astype(np.float64) for power in range(3))
    half = b + np.copysign(np.sqrt(b * b - 3.0 * a * c), b)  # 3a dt² + 2b dt + c = 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for moment in (first, last, -half / (3.0 * a), -c / half):
        dt = np.where(np.isnan(moment), first, np.clip(moment, first, last))
        place = means + ((a * dt + b) * dt + c) * dt
        low, high = np.minimum(low, place.min(axis=0)), np.maximum(high, place.max(axis=0))
    (x, y, z), (u, v, w) = low.tolist(), high.tolist()
    return Box((x, y, z), (u, v, w))


def _paths(powers: int) -> list[str]:
    return [f"motion_{i}" for i in range(3 * powers)]
