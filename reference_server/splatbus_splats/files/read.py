"""Reading of files, and of folders of them; what is no Gaussian is left out and counted."""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from io import BufferedReader
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.files import foreign, packed, ply, spacetime, splat
from splatbus_splats.files.spacetime import Motion
from splatbus_splats.gaussians import NO_ORIGIN, Gaussians, Vector, empty

STEP = 1 << 14
"""Gaussians at a time: what is worked on beside the result is 13 MB."""
SUFFIXES = (".ply", ".splat", *packed.FORMATS)

BRIGHTEST = np.float32(1e36)
"""Of a harmonic: the sum of 16 is finite in float32 then."""

FAR = 1e4
"""Units from 0: from there on float32 has steps of a thousandth."""
LEAST_SEEN = 1.0 / 255.0
"""Opacity of a Gaussian that is drawn."""
INVISIBLE = "nothing of it can be seen: every opacity is below 1/255"
ACTIVATED = (
    "its values look as if they were activated before, and are so again: every opacity is from 0 "
    "to 1 where a logit is read, and every scale above 0 where a logarithm is; export raw values"
)
Progress = Callable[[int, int], None]


class Found(NamedTuple):
    """What was in a file."""

    gaussians: Gaussians
    left_out: dict[str, int]
    """How many Gaussians are not among them, by what is wrong with them."""
    motion: Motion | None = None
    """How they change, where they live in time: `gaussians` has each at its own moment then."""
    doubts: tuple[str, ...] = ()
    """What may be wrong with all of them, for people."""
    origin: Vector = NO_ORIGIN
    """(3,), from where positions are counted."""
    up: str = ""
    """Which axis its header says is upwards, such as "z"; nothing where it does not."""


def read(path: Path, progress: Progress | None = None, origin: Vector | None = NO_ORIGIN) -> Found:
    """The Gaussians in a `.ply` of 3DGS, a `.splat`, a packed file or glTF, as its name says.

    Those are left out of which a number is not finite once it is decoded, which a zero scale or an
    opacity of 1 is, a standard deviation negative, or the quaternion zero. Memory for one copy of
    the numbers is needed: the file is read in pieces.

    Args:
        path: of the file.
        progress: is told now and then how many Gaussians of how many were read.
        origin: (3,), from where positions are counted: it is subtracted in float64. None: from
            0, or from whole units in the middle of the file's first Gaussians where that is far
            from 0, as coordinates of maps are, so that float32 loses nothing.

    Raises:
        ValueError: it is no such file; the message names it, and what is wrong where.
        OSError: it cannot be read.
        ImportError: what reads packed files, or glTF, is not installed.
    """
    doubts, up = [], ""
    with _opened(path) as (file, size):
        if path.suffix.lower() == ".splat":
            count = splat.count(file, path, size)
            if origin is None:
                some = splat.parts(file, path, min(count, STEP), STEP, NO_ORIGIN)
                origin = _origin(next((each.means for each, _ in some), np.empty((0, 3))))
                file.seek(0)
            parts = splat.parts(file, path, count, STEP, origin)
            found = _gathered(parts, count, 1, False, progress)
        else:
            vertices = ply.vertices(file, path)
            rows, up = ply.first_rows(file, vertices, STEP), vertices.header.up
            if ply.is_activated(rows):
                doubts.append(ACTIVATED)
            if origin is None:
                origin = _origin(np.stack([rows[name] for name in ply.PLACE], axis=1))
            count, is_in_time = vertices.element.rows, vertices.time is not None
            of_file = ply.parts(file, vertices, STEP, origin)
            found = _gathered(of_file, count, vertices.coefficients, is_in_time, progress)
    if len(found.gaussians) and found.gaussians.opacities.max() < LEAST_SEEN:
        doubts.append(INVISIBLE)
    return found._replace(doubts=tuple(doubts), origin=origin, up=up)


def sequence(folder: Path) -> list[Path]:
    """The splat files of a folder in the order of the last number in their names; or its only one.

    Raises:
        ValueError: there is none, one of several has no number, or two have the same.
        OSError: the folder cannot be read.
    """
    found = [
        each
        for each in sorted(folder.iterdir())
        if each.suffix.lower() in SUFFIXES and not each.name.startswith(".") and each.is_file()
    ]
    if not found:
        raise ValueError(f"{folder}: no file of {' '.join(SUFFIXES)} is in it")
    if len(found) == 1:
        return found
    by_number: dict[int, Path] = {}
    for path in found:
        numbers = re.findall(r"[0-9]+", path.stem)
        if not numbers:
            raise ValueError(f"{path}: no number in its name says when it is")
        other = by_number.setdefault(int(numbers[-1]), path)
        if other is not path:
            raise ValueError(f"{path}: has the number of {other.name}")
    return [by_number[number] for number in sorted(by_number)]


@contextmanager
def _opened(path: Path) -> Iterator[tuple[BufferedReader, int]]:
    """A splat file by its name, and its bytes; errors as of `read`."""
    suffix, size = path.suffix.lower(), path.stat().st_size
    with path.open("rb") as file:
        if not size:
            raise ValueError(f"{path}: the file is empty")
        first = file.peek(foreign.MOST)
        kind, other = packed.format_of(path, first), foreign.recognised(first[: foreign.MOST])
        if other and not (kind and first.startswith(packed.BEGINS)):
            raise ValueError(f"{path}: no splat file: it is {other}")
        if suffix not in SUFFIXES:
            raise ValueError(
                f"{path}: no splat file: its name ends in none of {' '.join(SUFFIXES)}"
            )
        if not kind:
            yield file, size
            return
    with tempfile.TemporaryDirectory(prefix="splatbus-") as folder:
        plain = Path(folder, "plain.ply")
        packed.unpack(path, kind, plain)
        with plain.open("rb") as file:
            yield file, plain.stat().st_size


def _origin(points: NDArray[Any]) -> Vector:
    """From where positions such as these, (N, 3), are best counted."""
    sound = points[np.isfinite(points).all(axis=1)].astype(np.float64)
    middle = np.round(np.median(sound, axis=0)) if len(sound) else NO_ORIGIN
    return middle if np.abs(middle).max() >= FAR else NO_ORIGIN


def _gathered(
    parts: Iterable[tuple[Gaussians, Motion | None]],
    count: int,
    coefficients: int,
    is_in_time: bool,
    progress: Progress | None,
) -> Found:
    whole, kept, seen = empty(count, coefficients), 0, 0
    motions = spacetime.empty(count) if is_in_time else None
    left_out: Counter[str] = Counter()
    for part, motion in parts:
        good = _sound(part, motion, left_out)
        place = slice(kept, kept + int(good.sum()))
        turns = part.rotations[good].astype(np.float64)
        norms = np.linalg.norm(turns, axis=1, keepdims=True)
        for each in fields(Gaussians):
            if each.name != "rotations":
                getattr(whole, each.name)[place] = getattr(part, each.name)[good]
        whole.rotations[place] = turns / norms
        if motion is not None and motions is not None:
            for each in fields(Motion):
                getattr(motions, each.name)[place] = getattr(motion, each.name)[good]
            motions.turns[place] /= norms  # of which the quaternion that it is added to has none
        kept, seen = place.stop, seen + len(part)
        if progress is not None:
            progress(seen, count)
    return Found(whole[:kept], dict(left_out), None if motions is None else motions[:kept])


def _sound(part: Gaussians, motion: Motion | None, left_out: Counter[str]) -> NDArray[np.bool_]:
    """Which of them are Gaussians; counts the others, each by the first thing that is wrong."""
    good = np.ones(len(part), np.bool_)
    norms = np.linalg.norm(part.rotations.astype(np.float64), axis=1)
    brightest = np.abs(part.coefficients).max(axis=(1, 2), initial=0.0)
    checks = [
        ("position not finite", np.isfinite(part.means).all(axis=1)),
        ("scale not finite", np.isfinite(part.scales).all(axis=1)),
        ("scale negative", (part.scales >= 0.0).all(axis=1)),
        ("opacity not a number", ~np.isnan(part.opacities)),
        ("harmonics not finite", np.isfinite(brightest)),
        ("harmonics too large", brightest <= BRIGHTEST),
        ("quaternion not finite", np.isfinite(norms)),
        ("quaternion zero", norms > 0.0),
    ]
    if motion is not None:
        with np.errstate(all="ignore"):
            turned = np.abs(motion.turns) / norms[:, None]
            within = spacetime.reach(part, motion) <= np.finfo(np.float32).max
        checks += [
            ("time not a number", np.isfinite(motion.centers) & (motion.lives > 0.0)),
            ("motion not finite", within),
            ("turning not finite", (turned <= np.finfo(np.float32).max).all(axis=1)),
        ]
    for what, holds in checks:
        if wrong := int((good & ~holds).sum()):
            left_out[what] += wrong
        good &= holds
    return good
