"""Messages into packets, with the members in the order in which the specification shows them."""

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
    Text,
    ViewportSize,
    Welcome,
)
from splatbus_wire.poses import Pose


def encode(message: Message, *, typed_replies: bool = False) -> bytes:
    """Return a message as one packet, header included.

    Args:
        message: from either side.
        typed_replies: write replies with `type` and `id`, as after `welcome` [NEG-28]; without, as
            1.0 has them.

    Raises:
        ProtocolError: a number is not finite [JSN-4], a string is no text [JSN-1], or the payload
            is too long [FRM-2].
    """
    return encode_packet(serialize(message_object(message, typed_replies=typed_replies)))


def message_object(message: Message, *, typed_replies: bool = False) -> dict[str, Any]:
    """Return a message as the JSON object that is sent; arguments as of `encode`."""
    match message:
        case CameraPose(pose, timestamp, tag, intrinsics):
            return (
                _present(type="camera_pose", timestamp=timestamp)
                | _pose_as_objects(pose)
                | _present(tag=tag, intrinsics=intrinsics and intrinsics._asdict())
            )
        case PointCloudPose(pose, timestamp):
            return _present(type="point_cloud_pose", timestamp=timestamp) | _pose_as_objects(pose)
        case ObjectPose(name, pose, scale, timestamp):
            members = _present(type="object_pose", object=name, timestamp=timestamp)
            return members | _pose_as_objects(pose) | {"scale": scale}
        case SetTime(time):
            return {"type": "set_time", "time": time}
        case GetViewportSize(identifier, timestamp):
            return _present(type="get_viewport_size", id=identifier, timestamp=timestamp)
        case GetCameraPose(cam_idx, identifier, timestamp):
            return _present(
                type="get_camera_pose", cam_idx=cam_idx, id=identifier, timestamp=timestamp
            )
        case GetScene(identifier):
            return _present(type="get_scene", id=identifier)
        case SetViewport():
            return _present(type="set_viewport", **message._asdict())
        case Ping():
            return _present(type="ping", **message._asdict())
        case ViewportSize(width, height, identifier):
            reply = _present(type="viewport_size", id=identifier) if typed_replies else {}
            return reply | {"viewport_size": [width, height]}
        case CameraReply(pose, identifier, intrinsics):
            if not typed_replies:
                return _pose_as_arrays(pose)
            lens = _present(intrinsics=intrinsics and intrinsics._asdict())
            return _present(type="camera", id=identifier) | _pose_as_arrays(pose) | lens
        case Scene():
            return _scene_object(message)
        case Pong(t, server_time, identifier):
            return _present(type="pong", id=identifier, t=t, serverTime=server_time)
        case Hello(versions, client, capabilities, token):
            return _present(
                type="hello",
                versions=versions,
                client=client._asdict(),
                capabilities=capabilities,
                token=token,
            )
        case Welcome(version, server, capabilities):
            return {
                "type": "welcome",
                "version": version,
                "server": server._asdict(),
                "capabilities": capabilities,
            }
        case ErrorMessage():
            return _present(type="error", **message._asdict())
        case Opened(generation):
            return {"type": "opened", "generation": generation}
        case OpenFailed(generation, reason):
            return {"type": "open_failed", "generation": generation, "reason": reason}
        case Closed(generation):
            return {"type": "closed", "generation": generation}
        case Release(generation, seq):
            return {"type": "release", "generation": generation, "seq": seq}
        case Subscribe(channels):
            return {"type": "subscribe", "channels": sorted(channels)}
        case SubscribeTelemetry(names):
            return {
                "type": "subscribe_telemetry",
                "names": None if names is None else sorted(names),
            }
        case Telemetry(seq, time, series):
            listed = [_series_object(each) for each in series]
            return {"type": "telemetry", "seq": seq, "time": time, "series": listed}
        case Frame():
            return _frame_object(message)
        case InitPacket():
            return init_packet_object(message)


def _present(**members: Any) -> dict[str, Any]:
    return {name: value for name, value in members.items() if value is not None}


def _pose_as_objects(pose: Pose) -> dict[str, Any]:
    return {
        "position": dict(zip("xyz", pose.position, strict=True)),
        "rotation": dict(zip("xyzw", pose.rotation, strict=True)),
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
    match series:
        case Scalar(name, value, unit):
            return _present(name=name, kind="scalar", value=value, unit=unit)
        case Histogram(name, edges, counts):
            return {"name": name, "kind": "histogram", "edges": edges, "counts": counts}
        case Text(name, value):
            return {"name": name, "kind": "text", "value": value}
