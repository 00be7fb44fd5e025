"""The short way for poses, which are most of what arrives: one regular expression is the grammar.

What it matches is a JSON text of known members, each once, in the order that POS-4 recommends and
every deployed client keeps; so neither nesting, nor names, nor types are left to check. What it
does not match may be valid all the same: that is for the careful way to judge.
"""

import math
import re

from splatbus_schemas import LIMITS

from splatbus_wire.message_types import CameraPose, PointCloudPose
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import NORM_TOLERANCE

_MAX_POSITION: float = LIMITS["max_position"]

# Possessive throughout, so that a hostile text costs time linear in its length.
_NUMBER = rb"(-?+(?>0|[1-9][0-9]*+)(?:\.[0-9]++)?+(?:[eE][+-]?+[0-9]++)?+)"
_WHITE_SPACE = rb"[ \t\n\r]*+"


def _spaced(*tokens: bytes) -> bytes:
    return _WHITE_SPACE.join(tokens)


def _member(name: bytes, value: bytes) -> bytes:
    return _spaced(b'"' + name + b'"', b":", value)


def _vector(*axes: bytes) -> bytes:
    comma = _spaced(b"", b",", b"")
    return _spaced(rb"\{", comma.join(_member(axis, _NUMBER) for axis in axes), rb"\}")


_POSE = re.compile(
    _spaced(
        b"",
        rb"\{",
        _member(b"type", rb'"(camera_pose|point_cloud_pose)"'),
        b",",
        b"(?:" + _spaced(_member(b"timestamp", _NUMBER), b",", b"") + b")?+"
        + _member(b"position", _vector(b"x", b"y", b"z")),
        b",",
        _member(b"rotation", _vector(b"x", b"y", b"z", b"w"))
        + rb"(?:"
        + _spaced(b"", b",", _member(b"tag", rb'"([ !#-\[\]-~]{1,%d}+)"' % LIMITS["max_tag_chars"]))
        + b")?+",
        rb"\}",
        b"",
    )
)  # fmt: skip


def plain_pose(payload: bytes) -> CameraPose | PointCloudPose | None:
    """Return the pose in a payload that is plainly valid [POS-1 to POS-3, POS-8, CAM-1], or None.

    A `tag` of plain ASCII is taken; that of the Gaussians has no meaning [JSN-7].
    """
    found = _POSE.fullmatch(payload)
    if found is None:
        return None
    kind, seconds, x, y, z, i, j, k, w, tag = found.groups()
    position = px, py, pz = float(x), float(y), float(z)
    rotation = float(i), float(j), float(k), float(w)
    timestamp = None if seconds is None else float(seconds)
    # A number too large for double precision is an infinity here, and fails as too large.
    if (
        -_MAX_POSITION <= px <= _MAX_POSITION
        and -_MAX_POSITION <= py <= _MAX_POSITION
        and -_MAX_POSITION <= pz <= _MAX_POSITION
        and abs(math.hypot(*rotation) - 1.0) <= NORM_TOLERANCE
        and (timestamp is None or math.isfinite(timestamp))
    ):
        pose = Pose(position, rotation)
        if kind == b"point_cloud_pose":
            return PointCloudPose(pose, timestamp)
        return CameraPose(pose, timestamp, None if tag is None else tag.decode())
    return None
