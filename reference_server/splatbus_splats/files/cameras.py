"""`cameras.json`, which 3DGS writes beside what it trains: from where the pictures were taken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.lens import Lens
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import quaternion_from_matrix

MOST_PIXELS = 1 << 20
"""Of a picture, on a side."""


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
        entries = Field(json.loads(path.read_bytes(), parse_int=float), "", "").items(1)
    except RecursionError as error:
        raise ValueError(f"{path}: no list of cameras: it is nested too deeply") from error
    except ProtocolError as error:
        raise ValueError(f"{path}: no list of cameras: {error.message}") from error
    except ValueError as error:
        raise ValueError(f"{path}: no cameras.json of 3DGS: {error}") from error
    found = []
    for i, entry in enumerate(entries):
        try:
            found.append(_camera(entry._replace(pointer=""), near, far))
        except ProtocolError as error:
            raise ValueError(f"{path}: camera {i}: {error.message}") from error
    return found


def _camera(entry: Field, near: float, far: float) -> Camera:
    width, height = (entry.member(name).integer(1, MOST_PIXELS) for name in ("width", "height"))
    fx, fy = (entry.member(name).positive() for name in ("fx", "fy"))
    position, rotation = entry.member("position").vector(), entry.member("rotation")
    a, b, c = (row.vector() for row in rotation.items(3, 3))
    try:
        turn = quaternion_from_matrix((*a, *b, *c))
    except ValueError as error:
        raise rotation.refused(str(error)) from error
    lens = Lens(fx, fy, width / 2.0, height / 2.0, width, height, near, far)
    return Camera(str(entry.value.get("img_name", "its picture")), Pose(position, turn), lens)
