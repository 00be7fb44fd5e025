"""`cameras.json`, which 3DGS writes beside what it trains: from where the pictures were taken."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_wire.lens import Lens
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import quaternion_from_matrix


class Camera(NamedTuple):
    """One of them."""

    name: str
    """Of its picture."""
    pose: Pose
    """Camera-to-world, axes of the camera x right, y down, z forward [CNV-1]."""
    lens: Lens
    """In pixels of its picture; the principal point, which the file lacks, is in the middle."""


def read_cameras(path: Path, near: float = 0.01, far: float = 100.0) -> list[Camera]:
    """The cameras in the order of the file.

    Args:
        path: of the file.
        near: least depth that is seen, scene units, of which the file knows nothing.
        far: largest depth that is seen.

    Raises:
        ValueError: it is no such file; the message names it, and what is wrong where.
        OSError: it cannot be read.
    """
    try:
        entries = json.loads(path.read_bytes())
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: byte {error.start} is none of a text") from error
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise ValueError(f"{path}: no cameras.json of 3DGS: {error.msg} at {where}") from error
    except RecursionError as error:
        raise ValueError(f"{path}: no list of cameras: it is nested too deeply") from error
    if not isinstance(entries, list):
        raise ValueError(f"{path}: no list of cameras, which cameras.json of 3DGS is")
    if not entries:
        raise ValueError(f"{path}: no cameras are in it")
    return [_camera(each, f"{path}: camera {i}", near, far) for i, each in enumerate(entries)]


def _camera(entry: Any, where: str, near: float, far: float) -> Camera:
    if not isinstance(entry, dict):
        raise ValueError(f"{where} is no object")
    for name in ("width", "height", "position", "rotation", "fx", "fy"):
        if name not in entry:
            raise ValueError(f"{where} has no {name}")
    width, height = (_size(entry[name], f"{where}: {name}") for name in ("width", "height"))
    fx, fy = (_number(entry[name], f"{where}: {name}") for name in ("fx", "fy"))
    if fx <= 0.0 or fy <= 0.0:
        raise ValueError(f"{where}: fx and fy are {fx} and {fy}, and not positive")
    x, y, z = _numbers(entry["position"], f"{where}: position")
    rows = entry["rotation"]
    if not isinstance(rows, list) or len(rows) != 3:
        raise ValueError(f"{where}: rotation is no matrix of three rows")
    a, b, c = (_numbers(row, f"{where}: rotation, row {i}") for i, row in enumerate(rows))
    try:
        rotation = quaternion_from_matrix((*a, *b, *c))
    except ValueError as error:
        raise ValueError(f"{where}: rotation {error}") from error
    lens = Lens(fx, fy, width / 2.0, height / 2.0, width, height, near, far)
    return Camera(str(entry.get("img_name", "its picture")), Pose((x, y, z), rotation), lens)


def _numbers(value: Any, where: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError(f"{where} is no list of three numbers")
    a, b, c = (_number(each, where) for each in value)
    return a, b, c


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{where} has {value!r}, which is no number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{where} has a number that is not finite")
    return number


def _size(value: Any, where: str) -> int:
    number = _number(value, where)
    if number < 1.0 or not number.is_integer():
        raise ValueError(f"{where} is {value!r}, and no number of pixels")
    return int(number)
