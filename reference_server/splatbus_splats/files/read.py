"""Reading of files, and of folders of them; what is no Gaussian is left out and counted."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.files import splat
from splatbus_splats.gaussians import Gaussians, empty

STEP = 1 << 14
"""Gaussians at a time: what is worked on beside the file and the result is 9 MB."""
SUFFIXES = (".ply", ".splat")


class Found(NamedTuple):
    """What was in a file."""

    gaussians: Gaussians
    left_out: dict[str, int]
    """How many Gaussians are not among them, by what is wrong with them."""


def read(path: Path, progress: Callable[[int, int], None] | None = None) -> Found:
    """The Gaussians in a file of 3DGS (`.ply`) or a `.splat`, as its name says.

    Those are left out of which a number is not finite once it is decoded, which a zero scale or an
    opacity of 1 is, a standard deviation negative, or the quaternion zero. Beside the file, which
    is mapped where it is binary, memory for one copy of its numbers is needed.

    Args:
        path: of the file.
        progress: is told now and then how many Gaussians of how many were read.

    Raises:
        ValueError: it is no such file; the message names it, and what is wrong where.
        OSError: it cannot be read.
        ImportError: PLY, without plyfile (extra `splats`).
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{path}: no splat file: its name ends in neither .ply nor .splat")
    if not path.stat().st_size:
        raise ValueError(f"{path}: the file is empty")
    if suffix == ".splat":
        records = splat.records(path)
        return _gathered(splat.parts(records, STEP), len(records), 1, progress)

    from splatbus_splats.files import ply  # needs the extra

    vertices, coefficients = ply.vertices(path)
    parts = ply.parts(vertices, coefficients, STEP)
    return _gathered(parts, len(vertices), coefficients, progress)


def sequence(folder: Path) -> list[Path]:
    """The splat files of a folder in the order of the last number in their names.

    Raises:
        ValueError: there is none, one has no number, or two have the same.
        OSError: the folder cannot be read.
    """
    by_number: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES:
            numbers = re.findall(r"[0-9]+", path.stem)
            if not numbers:
                raise ValueError(f"{path}: no number in its name says when it is")
            other = by_number.setdefault(int(numbers[-1]), path)
            if other is not path:
                raise ValueError(f"{path}: has the number of {other.name}")
    if not by_number:
        raise ValueError(f"{folder}: no files {' or '.join(SUFFIXES)} are in it")
    return [by_number[number] for number in sorted(by_number)]


def _gathered(
    parts: Iterable[Gaussians],
    count: int,
    coefficients: int,
    progress: Callable[[int, int], None] | None,
) -> Found:
    whole, kept, seen = empty(count, coefficients), 0, 0
    left_out: Counter[str] = Counter()
    for part in parts:
        good = _sound(part, left_out)
        place = whole[kept : kept + int(good.sum())]
        place.means[:] = part.means[good]
        place.scales[:] = part.scales[good]
        place.opacities[:] = part.opacities[good]
        place.coefficients[:] = part.coefficients[good]
        turns = part.rotations[good].astype(np.float64)
        place.rotations[:] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
        kept, seen = kept + len(place), seen + len(part)
        if progress is not None:
            progress(seen, count)
    return Found(whole[:kept], dict(left_out))


def _sound(part: Gaussians, left_out: Counter[str]) -> NDArray[np.bool_]:
    """Which of them are Gaussians; counts the others, each by the first thing that is wrong."""
    good = np.ones(len(part), np.bool_)
    norms = np.linalg.norm(part.rotations.astype(np.float64), axis=1)
    for what, holds in (
        ("position not finite", np.isfinite(part.means).all(axis=1)),
        ("scale not finite", np.isfinite(part.scales).all(axis=1)),
        ("scale negative", (part.scales >= 0.0).all(axis=1)),
        ("opacity not a number", ~np.isnan(part.opacities)),
        ("harmonics not finite", np.isfinite(part.coefficients).all(axis=(1, 2))),
        ("quaternion not finite", np.isfinite(norms)),
        ("quaternion zero", norms > 0.0),
    ):
        if wrong := int((good & ~holds).sum()):
            left_out[what] += wrong
        good &= holds
    return good
