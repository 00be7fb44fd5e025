"""What a message that steers must be, to be taken: agreed upon, and about this scene."""

from __future__ import annotations

from splatbus_wire.lens import fits
from splatbus_wire.messages import CameraPose, Move, ObjectPose, SetTime

from splatbus_server.connection import Connection, Refusal
from splatbus_server.control import Poses

TimeRange = tuple[float, float]


def objection(
    connection: Connection, message: Move, poses: Poses, width: int, height: int
) -> Refusal | None:
    """Why the message is refused, whoever has control; None if it is valid.

    Args:
        connection: that sent it.
        message: as decoded.
        poses: of the scene's objects.
        width: of the images.
        height: of the images.
    """
    if isinstance(message, CameraPose) and message.intrinsics is not None:
        lens = message.intrinsics
        if not connection.has("intrinsics"):
            reason = "intrinsics were not agreed upon [NEG-5]"
            return Refusal("unsupported", reason, "/intrinsics")
        if not fits(lens, width, height):
            reason = f"{lens.width}×{lens.height} has not the shape of {width}×{height} [CAM-6]"
            return Refusal("invalid_message", reason, "/intrinsics")
    if isinstance(message, ObjectPose) and message.object not in poses.objects:
        reason = f"the scene has no object {message.object!r} [OBJ-3]"
        return Refusal("unknown_object", reason, "/object")
    return None


def within(message: Move, time_range: TimeRange | None) -> Move:
    """The message, with a time that the scene has [TIM-2]."""
    if isinstance(message, SetTime) and time_range is not None:
        first, last = time_range
        return SetTime(min(max(message.time, first), last))
    return message
