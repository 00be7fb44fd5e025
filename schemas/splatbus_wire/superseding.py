"""Of messages that steer, the newest about a thing takes the place of the one before [POS-7]."""

from __future__ import annotations

from typing import TypeVar, Union

from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    Move,
    ObjectPose,
    PointCloudPose,
    SubscribeTelemetry,
)

Told = Union[Move, SubscribeTelemetry]
"""What has no reply."""
T = TypeVar("T", bound=Told)


def subject(message: Told) -> object:
    """Return what the message is about: an object's id [OBJ-2], or its type."""
    if isinstance(message, ObjectPose):
        return message.object
    return DEFAULT_OBJECT if isinstance(message, PointCloudPose) else type(message)


def succeeding(former: Told | None, message: T) -> T:
    """Return the message, with what stays in force of the one whose place it takes [CAM-7]."""
    if isinstance(message, CameraPose) and isinstance(former, CameraPose):
        return message._replace(intrinsics=message.intrinsics or former.intrinsics)
    return message
