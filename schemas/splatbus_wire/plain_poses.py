"""The short way for poses, which are most of what arrives: one regular expression is the grammar.

The members are in the order that POS-4 recommends and every deployed client keeps. What is not
plainly valid may be valid all the same: that is for the careful way to judge.
"""

from __future__ import annotations

import math

from splatbus_schemas import LIMITS

from splatbus_wire.message_types import CameraPose, PointCloudPose
from splatbus_wire.plain import NUMBER, expression, member, members, object_of, spaced, text, then
from splatbus_wire.poses import Pose
from splatbus_wire.rotations import NORM_TOLERANCE

_MAX_POSITION: float = LIMITS["max_position"]


def _vector(axes: str) -> bytes:
    return object_of(members(*(member(axis.encode(), NUMBER) for axis in axes)))


_POSE = expression(
    spaced(
        b"",
        object_of(
            members(
                member(b"type", rb'"(camera_pose|point_cloud_pose)"'),
                b"(?:" + spaced(member(b"timestamp", NUMBER), b",", b"") + b")?+"
                + member(b"position", _vector("xyz")),
                member(b"rotation", _vector("xyzw")),
            )
            + then(member(b"tag", text(LIMITS["max_tag_chars"])))
        ),
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
