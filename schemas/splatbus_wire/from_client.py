"""What a client sends, parsed: each function takes one message's fields."""

from __future__ import annotations

from typing import Any

from splatbus_schemas import LIMITS

from splatbus_wire.fields import MAX_SAFE_INTEGER, Field, object_pose
from splatbus_wire.message_types import (
    CameraPose,
    ClientMessage,
    Closed,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    ObjectPose,
    Opened,
    OpenFailed,
    Ping,
    PointCloudPose,
    Release,
    SetTime,
    SetViewport,
    Subscribe,
    SubscribeTelemetry,
)
from splatbus_wire.parts import (
    MAX_IMAGE_SIZE,
    MAX_NAME_CHARS,
    capabilities,
    different,
    intrinsics,
    program,
    version,
)
from splatbus_wire.poses import Pose

_CHANNELS = ("color", "depth")
_SCALES: tuple[float, float] = LIMITS["min_scale"], LIMITS["max_scale"]


def pose_of_1_0(kind: str, message: Field) -> CameraPose | PointCloudPose:
    """A pose before `hello`: its numbers may be spelled as strings [JSN-11]."""
    posed = pose_and_timestamp(message, or_strings=True)
    return CameraPose(*posed) if kind == "camera_pose" else PointCloudPose(*posed)


def request_of_1_0(kind: str, message: Field) -> GetViewportSize | GetCameraPose:
    """A request before `hello`, which knows no `id` [NEG-27]."""
    if kind == "get_viewport_size":
        return GetViewportSize(None, timestamp(message))
    return GetCameraPose(_cam_idx(message), None, timestamp(message))


def on_message_channel(kind: Any, message: Field) -> ClientMessage | None:
    """A message of the message channel after `hello`; None if the type is unknown."""
    if kind == "camera_pose":
        return pose_of_camera(message)
    if kind == "point_cloud_pose":
        return PointCloudPose(*pose_and_timestamp(message))
    if kind == "object_pose":
        return pose_of_object(message)
    if kind == "set_time":
        return SetTime(message.under("TIM-1").member("time").number())
    if kind == "get_viewport_size":
        return GetViewportSize(_id(message), timestamp(message))
    if kind == "get_camera_pose":
        return GetCameraPose(_cam_idx(message), _id(message), timestamp(message))
    if kind == "get_scene":
        return GetScene(_id(message))
    if kind == "set_viewport":
        return viewport_wanted(message)
    if kind == "ping":
        return Ping(message.under("PNG-1").member("t").number(), _id(message))
    if kind == "subscribe_telemetry":
        return SubscribeTelemetry(_names(message.under("TEL-1").member("names")))
    return None


def on_ipc_channel(kind: Any, message: Field) -> ClientMessage | None:
    """A message of the IPC channel; None if the type is unknown."""
    if kind == "opened":
        return Opened(message.under("OPN-13").generation())
    if kind == "open_failed":
        reason = message.under("OPN-13").member("reason").under("OPN-3")
        return OpenFailed(
            message.under("OPN-13").generation(), reason.string(1, LIMITS["max_reason_chars"])
        )
    if kind == "closed":
        return Closed(message.under("OPN-13").generation())
    if kind == "release":
        released = message.under("IMG-12")
        return Release(released.generation(), released.seq())
    if kind == "subscribe":
        return _subscribe(message.under("IMG-19"))
    return None


def hello(message: Field) -> Hello:
    """The first message of a connection, on either channel [NEG-2]."""
    token = message.optional("token")
    return Hello(
        tuple(map(version, message.member("versions").items(1, LIMITS["max_versions"]))),
        program(message.member("client")),
        capabilities(message.member("capabilities")),
        None if token is None else token.string(1, LIMITS["max_token_chars"]),
    )


def pose_and_timestamp(message: Field, *, or_strings: bool = False) -> tuple[Pose, float | None]:
    """What all poses of 1.0 have [POS-1, POS-8]."""
    pose = object_pose(message.under("POS-1"), or_strings=or_strings)
    return pose, timestamp(message, or_string=or_strings)


def timestamp(message: Field, *, or_string: bool = False) -> float | None:
    """When it was sent, if that was said [POS-8]."""
    given = message.under("POS-8").optional("timestamp")
    return None if given is None else given.number(or_string=or_string)


def pose_of_camera(message: Field) -> CameraPose:
    """A `camera_pose` after `hello` [CAM-1]."""
    tag, lens = message.optional("tag"), message.optional("intrinsics")
    return CameraPose(
        *pose_and_timestamp(message),
        None if tag is None else tag.under("CAM-1").string(1, LIMITS["max_tag_chars"]),
        None if lens is None else intrinsics(lens.under("CAM-4")),
    )


def pose_of_object(message: Field) -> ObjectPose:
    """An `object_pose` [OBJ-1]."""
    described = message.under("OBJ-1")
    name, scale = described.member("object"), described.optional("scale")
    pose, when = pose_and_timestamp(message)
    return ObjectPose(
        name.string(1, MAX_NAME_CHARS),
        pose,
        1.0 if scale is None else scale.between(*_SCALES),
        when,
    )


def viewport_wanted(message: Field) -> SetViewport:
    """A `set_viewport` [VPT-1]."""
    size = message.under("VPT-1")
    width, height = (size.member(side).integer(1, MAX_IMAGE_SIZE) for side in ("width", "height"))
    return SetViewport(width, height, _id(message))


def _cam_idx(message: Field) -> int:
    return message.under("REQ-2").member("cam_idx").integer(-MAX_SAFE_INTEGER, MAX_SAFE_INTEGER)


def _id(message: Field) -> int | None:
    return message.under("NEG-27").id()


def _subscribe(subscribe: Field) -> Subscribe:
    channels = subscribe.member("channels")
    return Subscribe(
        frozenset(different(channels, [item.one_of(_CHANNELS) for item in channels.items(1, 2)]))
    )


def _names(names: Field) -> frozenset[str] | None:
    if names.value is None:
        return None
    items = names.items(0, LIMITS["max_series"])
    return frozenset(different(names, [item.string(1, MAX_NAME_CHARS) for item in items]))
