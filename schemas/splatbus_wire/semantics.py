"""What the numbers in the buffers mean (1.1 section 3.4)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from splatbus_wire.fields import Field
from splatbus_wire.poses import Vector

_ALPHAS = ("straight", "premultiplied")
_COLOR_SPACES = ("srgb", "linear")
_DEPTH_KINDS = ("planar_z", "ray_distance")
_DEPTH_ESTIMATORS = ("harmonic", "expected", "median")


class Semantics(NamedTuple):
    """What the numbers in the buffers mean; rows are bottom-up always [MEM-12].

    `depth_empty` may be infinity; `unit_metres` is None where it is not known; a position in the
    scene's own coordinates is the position on the wire plus `origin`.
    """

    alpha: str = "straight"
    color_space: str = "srgb"
    depth_kind: str = "planar_z"
    depth_estimator: str = "harmonic"
    depth_empty: float = math.inf
    unit_metres: float | None = None
    origin: Vector = (0.0, 0.0, 0.0)


def parse_semantics(semantics: Field) -> Semantics:
    """Take the member `semantics` of an init packet [MEM-12]; raises ProtocolError."""
    semantics.member("rows").one_of(["bottom_up"])
    depth = semantics.member("depth")
    empty = depth.member("empty")
    unit = semantics.member("unitMetres")
    return Semantics(
        semantics.member("alpha").one_of(_ALPHAS),
        semantics.member("colorSpace").one_of(_COLOR_SPACES),
        depth.member("kind").one_of(_DEPTH_KINDS),
        depth.member("estimator").one_of(_DEPTH_ESTIMATORS),
        math.inf if empty.value == "inf" else empty.single(),
        None if unit.value is None else unit.positive(),
        semantics.member("origin").vector(),
    )


def semantics_object(semantics: Semantics) -> dict[str, Any]:
    """Return the member `semantics` of an init packet [MEM-12]."""
    empty = semantics.depth_empty
    return {
        "rows": "bottom_up",
        "alpha": semantics.alpha,
        "colorSpace": semantics.color_space,
        "depth": {
            "kind": semantics.depth_kind,
            "estimator": semantics.depth_estimator,
            "empty": "inf" if empty == math.inf else empty,
        },
        "unitMetres": semantics.unit_metres,
        "origin": list(semantics.origin),
    }


def checked_semantics(semantics: Semantics) -> Semantics:
    """The semantics, which a client can read; ValueError (ProtocolError) if none could."""
    return parse_semantics(Field(semantics_object(semantics), "/semantics", "MEM-12"))
