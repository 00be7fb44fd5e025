"""What a client may send: checked before it leaves, and no more of it than was agreed [NEG-5].

Functions from messages to messages; nothing here sends.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, TypeVar, Union, cast

from splatbus_wire.fields import Field
from splatbus_wire.from_client import on_message_channel
from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    GetScene,
    Message,
    ObjectPose,
    Ping,
    PointCloudPose,
    Request,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
    encode,
    message_object,
)

Told = Union[CameraPose, ObjectPose, SetTime, SubscribeTelemetry]
"""What has no reply, and of which only the newest of a kind matters [POS-7]."""
M = TypeVar("M", bound=Union[Told, Request])
_CAPABILITIES: dict[type, str] = {
    ObjectPose: "objects",
    SetTime: "time",
    SubscribeTelemetry: "telemetry",
    GetScene: "scene",
    SetViewport: "viewport",
    Ping: "ping",
}


def needs(message: Told | Request) -> str | None:
    """Return the capability without which the message, or a part of it, may not be sent."""
    if isinstance(message, CameraPose):
        return None if message.intrinsics is None else "intrinsics"
    if isinstance(message, ObjectPose):
        whole = (message.object, message.scale) == (DEFAULT_OBJECT, 1.0)
        return None if whole else "objects"
    return _CAPABILITIES.get(type(message))


def only_1_1(message: Told | Request) -> bool:
    """Whether the message has anything that 1.0 does not know."""
    return needs(message) is not None or (
        isinstance(message, CameraPose) and message.tag is not None
    )


def permitted(
    message: Told, version: str | None, capabilities: Collection[str]
) -> Told | PointCloudPose | None:
    """Return what of the message may be sent on a connection, None for nothing [NEG-5].

    The pose of the object that 1.0 knows goes as 1.0 has it [OBJ-2].
    """
    needed = needs(message)
    missing = needed is not None and needed not in capabilities
    if isinstance(message, CameraPose):
        lens = None if missing else message.intrinsics
        tag = message.tag if version == "1.1" else None
        return message._replace(intrinsics=lens, tag=tag)
    if isinstance(message, ObjectPose) and needed is None:
        return PointCloudPose(message.pose, message.timestamp)
    return None if missing else message


def checked(message: M) -> M:
    """Return a message in plain numbers, whatever numbers it came in, as its receiver reads it.

    Raises:
        ProtocolError: a server would refuse it, for the requirement that is named.
    """
    members = _plain(message_object(message))
    read = on_message_channel(members["type"], Field(members, "", ""))
    encode(cast(Message, read))  # which looks at each text, and at how much it is in all
    return cast(M, read)


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    return float(value)
