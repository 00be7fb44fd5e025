"""Cameras as 3DGS writes them, for scenes that nobody took pictures of."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from splatbus_server.view import field_of_view

from splatbus_splats.made.parts import unit

SIZE = 960, 640


class Seen(NamedTuple):
    """From where to where one looks, scene units; y points down."""

    eye: tuple[float, float, float]
    at: tuple[float, float, float]


def cameras(views: Iterable[Seen]) -> list[dict[str, Any]]:
    """What `cameras.json` has of each: upright, with a vertical field of view of 60 degrees."""
    lens = field_of_view(*SIZE)
    return [
        {
            "id": number,
            "img_name": f"made_{number:02}",
            "width": SIZE[0],
            "height": SIZE[1],
            "position": list(seen.eye),
            "rotation": _toward(seen).tolist(),
            "fx": lens.fx,
            "fy": lens.fy,
        }
        for number, seen in enumerate(views)
    ]


def _toward(seen: Seen) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(3, 3), camera to world."""
    ahead = unit(np.subtract(seen.at, seen.eye))
    right = unit(np.cross((0.0, 1.0, 0.0), ahead))
    return np.stack((right, np.cross(ahead, right), ahead), axis=1)
