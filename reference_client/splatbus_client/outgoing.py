"""What a client may send: checked before it leaves, and no more of it than was agreed [NEG-5].

Functions from messages to messages; nothing here sends.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Union

from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import MAX_SAFE_INTEGER, Field
from splatbus_wire.messages import (
    DEFAULT_OBJECT,
    CameraPose,
    GetCameraPose,
    GetScene,
    Intrinsics,
    ObjectPose,
    Ping,
    PointCloudPose,
    Pose,
    Request,
    SetTime,
    SetViewport,
    SubscribeTelemetry,
)
from splatbus_wire.parts import MAX_IMAGE_SIZE, MAX_NAME_CHARS, intrinsics
from splatbus_wire.rotations import check_quaternion

Told = Union[CameraPose, ObjectPose, SetTime, SubscribeTelemetry]
"""What has no reply, and of which only the newest of a kind matters [POS-7]."""
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


def checked(message: Told) -> Told:
    """Return the message in plain numbers, whatever numbers it came in.

    Raises:
        ProtocolError: it breaks POS-2, POS-3, CAM-1, CAM-4, OBJ-1, TIM-1 or TEL-1.
    """
    if isinstance(message, CameraPose):
        if message.tag is not None:
            _text(Field(message.tag, "/tag", "CAM-1"), LIMITS["max_tag_chars"])
        lens = message.intrinsics
        return message._replace(pose=_pose(message.pose), intrinsics=lens and _lens(lens))
    if isinstance(message, ObjectPose):
        _text(Field(message.object, "/object", "OBJ-1"), MAX_NAME_CHARS)
        return message._replace(pose=_pose(message.pose), scale=_scale(message.scale))
    if isinstance(message, SetTime):
        return SetTime(Field(float(message.time), "/time", "TIM-1").number())
    _names(message.names)
    return message


def checked_request(request: Request) -> Request:
    """Return the request in plain numbers.

    Raises:
        ProtocolError: it breaks REQ-2, VPT-1 or PNG-1.
    """
    if isinstance(request, GetCameraPose):
        most = MAX_SAFE_INTEGER
        return GetCameraPose(Field(request.cam_idx, "/cam_idx", "REQ-2").integer(-most, most))
    if isinstance(request, SetViewport):
        return SetViewport(
            Field(request.width, "/width", "VPT-1").integer(1, MAX_IMAGE_SIZE),
            Field(request.height, "/height", "VPT-1").integer(1, MAX_IMAGE_SIZE),
        )
    if isinstance(request, Ping):
        return Ping(Field(float(request.t), "/t", "PNG-1").number())
    return request


def _pose(pose: Pose) -> Pose:
    """The pose in plain floats [POS-2, POS-3, ACC-1]."""
    x, y, z = map(float, pose.position)
    i, j, k, w = map(float, pose.rotation)
    if not all(abs(coordinate) <= LIMITS["max_position"] for coordinate in (x, y, z)):
        raise ProtocolError(
            "invalid_number",
            f"the position {(x, y, z)} is not within single precision",
            requirement="POS-2",
            pointer="/position",
        )
    check_quaternion((i, j, k, w), pointer="/rotation")
    return Pose((x, y, z), (i, j, k, w))


def _lens(lens: Intrinsics) -> Intrinsics:
    plain = {name: float(value) for name, value in lens._asdict().items()}
    return intrinsics(Field(plain, "/intrinsics", "CAM-4"))


def _scale(scale: float) -> float:
    field = Field(float(scale), "/scale", "OBJ-1")
    least, most = LIMITS["min_scale"], LIMITS["max_scale"]
    if not least <= field.number() <= most:
        raise field.refused(f"is {scale!r}, not from {least} to {most}")
    return field.number()


def _names(names: frozenset[str] | None) -> None:
    if names is None:
        return
    listed = Field(sorted(names, key=str), "/names", "TEL-1").items(0, LIMITS["max_series"])
    for name in listed:
        _text(name, MAX_NAME_CHARS)


def _text(field: Field, most: int) -> None:
    """Refuse what is no text of 1 to `most` characters, and what UTF-8 cannot hold [JSN-1]."""
    try:
        field.string(1, most).encode()
    except UnicodeEncodeError:
        raise field.under("JSN-1").refused("holds half of a surrogate pair") from None
