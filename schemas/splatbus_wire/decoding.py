"""Payloads into messages: strict about what is known, blind to what is not [JSN-7, JSN-8]."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Literal

from splatbus_schemas import LIMITS, read_json

from splatbus_wire import from_client, from_server
from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.init_packet import InitPacket, is_init_packet, parse_init_packet
from splatbus_wire.json_text import brief, parse_object
from splatbus_wire.message_types import (
    ClientMessage,
    ErrorMessage,
    Frame,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Ping,
    PointCloudPose,
    Reply,
    Request,
    SetViewport,
    Telemetry,
    Welcome,
)
from splatbus_wire.plain_frames import plain_frame
from splatbus_wire.plain_poses import plain_pose

Channel = Literal["ipc", "msg"]
MAX_CLIENT_VALUES: int = LIMITS["max_client_values"]

_CHANNELS: dict[str, Channel] = {"ipc": "ipc", "message": "msg"}
_NAMES = {"ipc": "IPC", "message": "message"}
SWAPPED = "are the two ports swapped?"
_MESSAGES: dict[str, Any] = read_json("messages.json")["messages"]
CAPABILITIES: dict[tuple[Channel, str], str] = {
    (_CHANNELS[channel], name): told["capability"]
    for name, told in _MESSAGES.items()
    for channel in told["channels"]
    if told["from"] == "client" and "capability" in told
}
"""To which a message of a client belongs, by its channel and type [NEG-5]."""
_REPLY_TYPES: dict[type[Any], str] = {
    GetViewportSize: "viewport_size",
    SetViewport: "viewport_size",
    GetCameraPose: "camera",
    GetScene: "scene",
    Ping: "pong",
}


def decode_from_client(
    payload: bytes,
    channel: Channel,
    *,
    said_hello: bool,
    agreed: Collection[str] | None = None,
) -> ClientMessage:
    """Return the message that a client sent.

    Args:
        payload: of one packet.
        channel: on which it arrived.
        said_hello: whether a `hello` came before it on the connection. Until then `id` is not known
            [NEG-27], and a pose may spell its numbers as strings [JSN-11].
        agreed: the capabilities of `welcome`, to refuse what belongs to others; None for all.

    Raises:
        ProtocolError: `malformed_json`, `not_an_object`, `invalid_number`, `invalid_rotation`,
            `invalid_message`, `unknown_type` for a message that is to be ignored [REQ-8, NEG-9],
            and `unsupported` for one whose capability was not agreed upon [NEG-5, NEG-36]. Its
            `received` holds the message, if that could be parsed.
    """
    if channel == "msg" and (pose := plain_pose(payload)) is not None:
        if said_hello or isinstance(pose, PointCloudPose) or pose.tag is None:
            return pose
        return pose._replace(tag=None)
    received = parse_object(payload, MAX_CLIENT_VALUES)
    try:
        return _from_client(Field(received, "", ""), channel, said_hello, agreed)
    except ProtocolError as error:
        error.received = received
        raise


def _from_client(
    message: Field, channel: Channel, said_hello: bool, agreed: Collection[str] | None
) -> ClientMessage:
    found: ClientMessage | None = None
    kind = message.value.get("type")
    needed = CAPABILITIES.get((channel, str(kind)))
    if agreed is not None and needed is not None and needed not in agreed:
        told = f"{needed} was not agreed upon"
        raise ProtocolError("unsupported", told, requirement="NEG-5")
    if kind == "hello":
        found = from_client.hello(message.under("NEG-2"))
    elif channel == "ipc":
        found = from_client.on_ipc_channel(kind, message)
    elif said_hello:
        found = from_client.on_message_channel(kind, message)
    elif kind in ("camera_pose", "point_cloud_pose"):
        found = from_client.pose_of_1_0(kind, message)
    elif kind in ("get_viewport_size", "get_camera_pose"):
        found = from_client.request_of_1_0(kind, message)
    if found is None:
        requirement = "NEG-9" if said_hello or channel == "ipc" else "REQ-8"
        raise _unknown_type(message, channel, requirement)
    return found


def decode_from_server_ipc(payload: bytes) -> InitPacket | Welcome | Frame | ErrorMessage:
    """Return the message that a server sent on the IPC channel.

    Raises:
        ProtocolError: as `decode_from_client`, with `unknown_type` also for an object that is no
            init packet [INI-11]. See `readable_generation` for what to answer to a bad init packet.
    """
    if (frame := plain_frame(payload)) is not None:
        return frame
    message = Field(parse_object(payload), "", "")
    kind = message.value.get("type")
    if kind == "welcome":
        return from_server.welcome(message)
    if kind == "error":
        return from_server.error(message.under("NEG-23"))
    if kind == "frame":
        return from_server.frame(message.under("IMG-1"))
    if is_init_packet(message.value):
        return parse_init_packet(message.value)
    raise _unknown_type(message, "ipc", "INI-11")


def decode_from_server_message(
    payload: bytes, request: Request | None
) -> Reply | Welcome | Telemetry | ErrorMessage:
    """Return the message that a server sent on the message channel.

    Args:
        payload: of one packet.
        request: the oldest that has no reply, which tells what a reply without `type` is [REQ-11].

    Raises:
        ProtocolError: as `decode_from_client`, with `unknown_type` also for a reply that nobody
            waits for [CHN-11], and `invalid_message` for one to another request [REQ-7, NEG-28].
    """
    message = Field(parse_object(payload), "", "CHN-11")
    typed = "type" in message.value
    kind = message.value["type"] if typed else _reply_type(request)
    reply: Reply
    if kind == "welcome":
        return from_server.welcome(message)
    if kind == "error":
        return from_server.error(message.under("NEG-23"))
    if kind == "telemetry":
        return from_server.telemetry(message)
    if kind == "viewport_size":
        reply = from_server.viewport_size(message)
    elif kind == "camera":
        reply = from_server.camera(message)
    elif kind == "scene" and typed:
        reply = from_server.scene(message)
    elif kind == "pong" and typed:
        reply = from_server.pong(message)
    elif kind is None and not typed:
        if is_init_packet(message.value):
            raise _unknown_type(message, "msg", "CHN-11")
        raise message.refused("answers no request", "unknown_type")
    else:
        raise _unknown_type(message, "msg", "NEG-9")
    if request is None:
        raise message.refused("answers no request", "unknown_type")
    if kind != _reply_type(request):
        raise message.under("REQ-7").refused(f"is a {kind}, which the oldest request is not for")
    if typed and reply.id != request.id:
        raise Field(reply.id, "/id", "NEG-28").refused(f"is {reply.id}, not {request.id}")
    return reply


def _reply_type(request: Request | None) -> str | None:
    return None if request is None else _REPLY_TYPES[type(request)]


def _unknown_type(message: Field, channel: Channel, requirement: str) -> ProtocolError:
    kind = Field(message.value.get("type"), "/type", requirement)
    if "type" not in message.value:
        told = "is missing"
        if channel == "msg" and is_init_packet(message.value):
            told += f", as in an init packet, which belongs on the IPC channel: {SWAPPED}"
        return kind.refused(told, "unknown_type")
    told = "is not known here"
    places = _MESSAGES.get(str(kind.value), {}).get("channels", ())
    if places and channel not in map(_CHANNELS.get, places):
        told = f"belongs on the {_NAMES[places[0]]} channel: {SWAPPED}"
    return kind.refused(f"is {brief(kind.value)}, which {told}", "unknown_type")
