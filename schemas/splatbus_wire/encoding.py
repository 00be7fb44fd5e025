"""Messages into packets, with the members in the order in which the specification shows them."""

from __future__ import annotations

from typing import Any

from splatbus_wire.framing import encode_packet
from splatbus_wire.init_packet import InitPacket, init_packet_object
from splatbus_wire.json_text import serialize
from splatbus_wire.message_types import (
    CameraPose,
    CameraReply,
    Closed,
    ErrorMessage,
    Frame,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Histogram,
    Intrinsics,
    Message,
    ObjectPose,
    Opened,
    OpenFailed,
    Ping,
    Placement,
    PointCloudPose,
    Pong,
    Release,
    Scalar,
    Scene,
    Series,
    SetTime,
    SetViewport,
    Subscribe,
    SubscribeTelemetry,
    Telemetry,
    ViewportSize,
    Welcome,
)
from splatbus_wire.poses import Pose

_BY_THEIR_MEMBERS: dict[type, str] = {
    SetTime: "set_time",
    GetViewportSize: "get_viewport_size",
    GetCameraPose: "get_camera_pose",
    GetScene: "get_scene",
    SetViewport: "set_viewport",
    Ping: "ping",
    ErrorMessage: "error",
    Opened: "opened",
    OpenFailed: "open_failed",
    Closed: "closed",
    Release: "release",
}
"""Messages whose members on the wire are those that they have here."""


def encode(message: Message, *, typed_replies: bool = False) -> bytes:
    """Return a message as one packet, header included.

    Args:
        message: from either side.
        typed_replies: write replies with `type` and `id`, as after `welcome` [NEG-28]; without, as
            1.0 has them.

    Raises:
        ProtocolError: a number is not finite [JSN-4], a string is no text [JSN-1], or the payload
            is too long [FRM-2] or has too many values [JSN-12].
    """
    return encode_packet(serialize(message_object(message, typed_replies=typed_replies)))


def message_object(message: Message, *, typed_replies: bool = False) -> dict[str, Any]:
    """Return a message as the JSON object that is sent; arguments as of `encode`."""
    if isinstance(message, CameraPose):
        return (
            _present(type="camera_pose", timestamp=message.timestamp)
            | _pose_as_objects(message.pose)
            | _present(tag=message.tag, intrinsics=_lens(message.intrinsics))
        )
    if isinstance(message, PointCloudPose):
        members = _present(type="point_cloud_pose", timestamp=message.timestamp)
        return members | _pose_as_objects(message.pose)
    if isinstance(message, ObjectPose):
        members = _present(type="object_pose", object=message.object, timestamp=message.timestamp)
        return members | _pose_as_objects(message.pose) | {"scale": message.scale}
    if isinstance(message, ViewportSize):
        reply = _present(type="viewport_size", id=message.id) if typed_replies else {}
        return reply | {"viewport_size": [message.width, message.height]}
    if isinstance(message, CameraReply):
        if not typed_replies:
            return _pose_as_arrays(message.pose)
        lens = _present(intrinsics=_lens(message.intrinsics))
        return _present(type="camera", id=message.id) | _pose_as_arrays(message.pose) | lens
    if isinstance(message, Scene):
        return _scene_object(message)
    if isinstance(message, Pong):
        return _present(type="pong", id=message.id, t=message.t, serverTime=message.server_time)
    if isinstance(message, Hello):
        return _present(type="hello", **message._asdict() | {"client": message.client._asdict()})
    if isinstance(message, Welcome):
        return {"type": "welcome", **message._asdict(), "server": message.server._asdict()}
    if isinstance(message, Subscribe):
        return {"type": "subscribe", "channels": sorted(message.channels)}
    if isinstance(message, SubscribeTelemetry):
        names = None if message.names is None else sorted(message.names, key=str)
        return {"type": "subscribe_telemetry", "names": names}
    if isinstance(message, Telemetry):
        listed = [_series_object(each) for each in message.series]
        return {"type": "telemetry", "seq": message.seq, "time": message.time, "series": listed}
    if isinstance(message, Frame):
        return _frame_object(message)
    if isinstance(message, InitPacket):
        return init_packet_object(message)
    return _present(type=_BY_THEIR_MEMBERS[type(message)], **message._asdict())


def _present(**members: Any) -> dict[str, Any]:
    return {name: value for name, value in members.items() if value is not None}


def _lens(intrinsics: Intrinsics | None) -> dict[str, Any] | None:
    return None if intrinsics is None else intrinsics._asdict()


def _pose_as_objects(pose: Pose) -> dict[str, Any]:
    return {
        "position": dict(zip("xyz", pose.position)),
        "rotation": dict(zip("xyzw", pose.rotation)),
    }


def _pose_as_arrays(pose: Pose) -> dict[str, Any]:
    return {"position": pose.position, "rotation": pose.rotation}


def _frame_object(frame: Frame) -> dict[str, Any]:
    camera = frame.camera._asdict()
    pose, tag = camera.pop("pose"), camera.pop("tag")
    objects = [_placement_object(placement) for placement in frame.objects]
    return {
        "type": "frame",
        "generation": frame.generation,
        "seq": frame.seq,
        "slot": frame.slot,
        "camera": _pose_as_arrays(pose) | camera | _present(tag=tag),
        **({"objects": objects} if objects else {}),
        "time": frame.time,
        "renderedAt": frame.rendered_at,
    }


def _placement_object(placement: Placement) -> dict[str, Any]:
    name, pose, scale = placement
    return {"object": name} | _pose_as_arrays(pose) | {"scale": scale}


def _scene_object(scene: Scene) -> dict[str, Any]:
    objects = [
        each._asdict() | {"bounds": each.bounds and each.bounds._asdict()} for each in scene.objects
    ]
    return _present(type="scene", id=scene.id) | {
        "objects": objects,
        "timeRange": scene.time_range,
        "cameras": scene.cameras,
        "origin": scene.origin,
    }


def _series_object(series: Series) -> dict[str, Any]:
    if isinstance(series, Scalar):
        return _present(name=series.name, kind="scalar", value=series.value, unit=series.unit)
    kind = "histogram" if isinstance(series, Histogram) else "text"
    return {"name": series.name, "kind": kind, **series._asdict()}
