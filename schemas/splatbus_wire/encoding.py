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
    GetViewportSize,
    Hello,
    Message,
    Opened,
    OpenFailed,
    PointCloudPose,
    Release,
    Subscribe,
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
        case CameraPose(pose, timestamp):
            return _present(type="camera_pose", timestamp=timestamp) | _pose_as_objects(pose)
        case PointCloudPose(pose, timestamp):
            return _present(type="point_cloud_pose", timestamp=timestamp) | _pose_as_objects(pose)
        case GetViewportSize(identifier, timestamp):
            return _present(type="get_viewport_size", id=identifier, timestamp=timestamp)
        case GetCameraPose(cam_idx, identifier, timestamp):
            return _present(
                type="get_camera_pose", cam_idx=cam_idx, id=identifier, timestamp=timestamp
            )
        case ViewportSize(width, height, identifier):
            reply = _present(type="viewport_size", id=identifier) if typed_replies else {}
            return reply | {"viewport_size": [width, height]}
        case CameraReply(pose, identifier):
            reply = _present(type="camera", id=identifier) if typed_replies else {}
            return reply | _pose_as_arrays(pose)
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
    return {
        "type": "frame",
        "generation": frame.generation,
        "seq": frame.seq,
        "slot": frame.slot,
        "camera": _pose_as_arrays(camera.pop("pose")) | camera,
        "time": frame.time,
        "renderedAt": frame.rendered_at,
    }
