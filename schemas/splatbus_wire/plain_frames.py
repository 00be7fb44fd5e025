"""The short way for frames: each image costs one, and none is seen before it is decoded.

The members are in the order in which the specification shows them, and the reference server writes
them. What is not plainly valid is for the careful way to judge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from splatbus_schemas import LIMITS

from splatbus_wire.message_types import Frame, FrameCamera, Placement
from splatbus_wire.plain import (
    INTEGER,
    NUMBER,
    array_of,
    expression,
    member,
    members,
    object_of,
    spaced,
    text,
    then,
    unnamed,
)
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import NORM_TOLERANCE

_MAX_SAFE_INTEGER: int = LIMITS["max_safe_integer"]
_MAX_SLOTS: int = LIMITS["max_slots"]
_MAX_IMAGE_SIZE: int = LIMITS["max_image_size"]
_MAX_POSITION: float = LIMITS["max_position"]
_MAX_OBJECTS: int = LIMITS["max_objects"]
_LEAST_NORM, _MOST_NORM = 1.0 - NORM_TOLERANCE, 1.0 + NORM_TOLERANCE

_POSE = members(member(b"position", array_of(3, NUMBER)), member(b"rotation", array_of(4, NUMBER)))
_PLACEMENT = object_of(
    members(member(b"object", text(LIMITS["max_name_chars"])), _POSE, member(b"scale", NUMBER))
)
_CAMERA = object_of(
    members(
        _POSE,
        *(member(name, NUMBER) for name in (b"fx", b"fy", b"cx", b"cy")),
        *(member(name, INTEGER) for name in (b"width", b"height")),
        *(member(name, NUMBER) for name in (b"near", b"far")),
    )
    + then(member(b"tag", text(LIMITS["max_tag_chars"])))
)
# The placements are found one by one afterwards: a group keeps only the last of its matches.
_ONE = unnamed(_PLACEMENT)
_OBJECTS = spaced(rb"\[", rb"(" + _ONE + rb"(?:" + spaced(b"", b",", _ONE) + rb")*+)", rb"\]")
_FRAME = expression(
    spaced(
        b"",
        object_of(
            members(
                member(b"type", b'"frame"'),
                *(member(name, INTEGER) for name in (b"generation", b"seq", b"slot")),
                member(b"camera", _CAMERA),
            )
            + then(member(b"objects", _OBJECTS))
            + spaced(b"", b",", b"")
            + members(member(b"time", NUMBER), member(b"renderedAt", NUMBER))
        ),
        b"",
    )
)
_EACH_PLACEMENT = expression(_PLACEMENT)


def plain_frame(payload: bytes) -> Frame | None:
    """Return the frame in a payload that is plainly valid [IMG-1, CAM-3, OBJ-7], or None."""
    found = _FRAME.fullmatch(payload)
    if found is None:
        return None
    generation, seq, slot = map(int, found.group(1, 2, 3))
    pose = _pose(found.group(4, 5, 6, 7, 8, 9, 10))
    fx, fy, cx, cy = map(float, found.group(11, 12, 13, 14))
    width, height = int(found.group(15)), int(found.group(16))
    near, far = float(found.group(17)), float(found.group(18))
    tag, listed, time, rendered_at = found.group(19, 20, 21, 22)
    seconds, rendered = float(time), float(rendered_at)
    # A number too large for double precision is an infinity here, and fails as that.
    if (
        pose is None
        or not 1 <= generation <= _MAX_SAFE_INTEGER
        or seq > _MAX_SAFE_INTEGER
        or slot >= _MAX_SLOTS
        or not 0.0 < fx < math.inf
        or not 0.0 < fy < math.inf
        or not 1 <= width <= _MAX_IMAGE_SIZE
        or not 1 <= height <= _MAX_IMAGE_SIZE
        or not 0.0 < near < far < math.inf
        or not all(map(math.isfinite, (cx, cy, seconds, rendered)))
    ):
        return None
    objects = () if listed is None else _placements(listed)
    if objects is None:
        return None
    camera = FrameCamera(
        pose, fx, fy, cx, cy, width, height, near, far, None if tag is None else tag.decode()
    )
    return Frame(generation, seq, slot, camera, seconds, rendered, objects)


def _pose(numbers: Sequence[bytes]) -> Pose | None:
    x, y, z, i, j, k, w = map(float, numbers)
    if (
        -_MAX_POSITION <= x <= _MAX_POSITION
        and -_MAX_POSITION <= y <= _MAX_POSITION
        and -_MAX_POSITION <= z <= _MAX_POSITION
        and _LEAST_NORM <= math.hypot(i, j, k, w) <= _MOST_NORM
    ):
        return Pose((x, y, z), (i, j, k, w))
    return None


def _placements(listed: bytes) -> tuple[Placement, ...] | None:
    placements = {}
    count = 0
    for found in _EACH_PLACEMENT.finditer(listed):
        name, *numbers, factor = found.groups()
        pose, scale = _pose(numbers), float(factor)
        if pose is None or not 0.0 < scale < math.inf:
            return None
        count += 1
        placements[name] = Placement(name.decode(), pose, scale)
    return tuple(placements.values()) if len(placements) == count <= _MAX_OBJECTS else None
