"""From what a person names to a scene: files, folders of numbered files, folders of models."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from splatbus_wire.messages import DEFAULT_OBJECT
from splatbus_wire.parts import MAX_NAME_CHARS

from splatbus_splats.files.read import read, sequence
from splatbus_splats.gaussians import Vector, curve
from splatbus_splats.scene import Clip, Frames, Part, Scene

Progress = Callable[[Path, int, int, float], None]
"""Is told the file, its number from 1, how many there are, and which share of all is read."""
CAMERAS = "cameras.json"
FOLDERS_ABOVE = 3
"""In which it is looked for beside the file: a model has it two above `point_cloud.ply`."""


class Source(NamedTuple):
    """What one argument means."""

    label: str
    """Its name for people."""
    stem: str
    files: list[Path]
    """One, or those of a sequence."""


class Loaded(NamedTuple):
    """An object of the scene."""

    label: str
    part: Part
    left_out: Counter[str]
    """How many Gaussians are not in it, by what is wrong with them."""
    doubts: dict[str, None]
    """What may be wrong with all that are in a file of it."""
    origin: Vector
    """(3,), from where its positions are counted."""
    up: str
    """Which axis its files say is upwards, such as "z"; nothing where none does."""


def source(path: Path) -> Source:
    """What is meant by a file or a folder.

    Raises:
        ValueError: a folder that is neither a model nor a sequence.
        OSError: it cannot be read.
    """
    if not path.is_dir():
        path.stat()  # before others are read
        return Source(path.name, path.stem, [path])
    name = path.resolve().name
    if model := _model(path):
        return Source(name, name, [model])
    try:
        return Source(name, name, sequence(path))
    except ValueError as error:
        raise ValueError(
            f"{error}; a folder is served that has numbered files of Gaussians, or a trained"
            " model, which has point_cloud/iteration_N/point_cloud.ply"
        ) from None


def loaded(
    sources: Sequence[Source],
    rate: float,
    seconds: float,
    progress: Progress | None = None,
) -> dict[str, Loaded]:
    """The objects by their ids, their Gaussians in the order of `gaussians.curve`.

    Positions of all are counted from the origin of the first file.

    Args:
        sources: of which each is one.
        rate: files a second, in sequences.
        seconds: length of clips, of Gaussians that live in time.
        progress: is told how far it is.

    Raises:
        ValueError: a file is none of Gaussians, or one that cannot be part of a sequence.
        OSError: a file cannot be read.
    """
    whole = sum(len(each.files) for each in sources)
    objects, number = {}, 0
    origin: Vector | None = None
    for name, (label, _, files) in zip(ids([each.stem for each in sources]), sources):
        frames, left_out, doubts = [], Counter[str](), dict[str, None]()
        up = ""
        for path in files:
            number += 1

            def tell(done: int, count: int, path: Path = path, number: int = number) -> None:
                if progress is not None:
                    progress(path, number, whole, (number - 1 + done / count) / whole)

            gaussians, without, motion, doubtful, origin, said = read(path, tell, origin)
            up = up or said
            doubts.update(dict.fromkeys(doubtful))
            order = curve(gaussians.means)
            gaussians = gaussians[order]
            left_out.update(without)
            if motion is None:
                frames.append(gaussians)
            elif len(files) == 1:
                clip = Clip(gaussians, motion[order], seconds)
                objects[name] = Loaded(label, clip, left_out, doubts, origin, up)
            else:
                raise ValueError(
                    f"{path}: Gaussians that live in time cannot be one file of a sequence:"
                    " serve the file by itself"
                )
        if frames and origin is not None:
            part = Frames(tuple(frames), rate)
            objects[name] = Loaded(label, part, left_out, doubts, origin, up)
    return objects


def scene_of(objects: dict[str, Loaded]) -> Scene:
    """The scene of these objects."""
    return Scene({name: each.part for name, each in objects.items()})


def ids(stems: Sequence[str]) -> list[str]:
    """Ids for objects, all different: the first is the one that clients of 1.0 can move.

    The others are called as their files, as far as the protocol has room.
    """
    given: list[str] = [DEFAULT_OBJECT]
    for stem in stems[1:]:
        whole = told(stem) or "object"
        name, number = whole, 2
        while name in given:
            name, number = f"{whole[: MAX_NAME_CHARS - 4]}-{number}", number + 1
        given.append(name)
    return given[: len(stems)]


def told(name: str) -> str:
    """A name of a file as clients are told it: as long as may be, of characters of Unicode."""
    return name.encode("utf-8", "replace").decode("utf-8")[:MAX_NAME_CHARS]


def cameras_near(path: Path) -> Path | None:
    """A `cameras.json` beside a file, or in a folder above it, as a model has it."""
    folders = path.resolve().parents[: 1 + FOLDERS_ABOVE]
    return next((each / CAMERAS for each in folders if (each / CAMERAS).is_file()), None)


def _model(folder: Path) -> Path | None:
    """The file of a trained model, the last that was saved."""
    found = {
        int(match[1]): each / "point_cloud.ply"
        for each in (folder / "point_cloud").glob("iteration_*")
        if (match := re.fullmatch(r"iteration_([0-9]+)", each.name))
        and (each / "point_cloud.ply").is_file()
    }
    return found[max(found)] if found else None
