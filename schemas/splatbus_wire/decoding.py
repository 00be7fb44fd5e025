"""Payloads into messages: strict about what is known, blind to what is not [JSN-7, JSN-8]."""

import re
from typing import Literal

from splatbus_schemas import LIMITS

from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import MAX_SAFE_INTEGER, Field, array_pose, object_pose
from splatbus_wire.init_packet import InitPacket, is_init_packet, parse_init_packet
from splatbus_wire.json_text import brief, parse_object
from splatbus_wire.message_types import (
    CameraPose,
    CameraReply,
    ClientMessage,
    Closed,
    ErrorMessage,
    Frame,
    FrameCamera,
    GetCameraPose,
    GetViewportSize,
    Hello,
    Opened,
    OpenFailed,
    PointCloudPose,
    Program,
    Release,
    Request,
    Subscribe,
    ViewportSize,
    Welcome,
)
from splatbus_wire.plain_poses import plain_pose
from splatbus_wire.poses import Pose

Channel = Literal["ipc", "message"]

_MAX_IMAGE_SIZE: int = LIMITS["max_image_size"]
_MAX_NAME_CHARS: int = LIMITS["max_name_chars"]
_CHANNELS = ("color", "depth")
_VERSION = re.compile(r"(?:0|[1-9][0-9]*)\.(?:0|[1-9][0-9]*)")


def decode_from_client(payload: bytes, channel: Channel, *, said_hello: bool) -> ClientMessage:
    """Return the message that a client sent.

    Args:
        payload: of one packet.
        channel: on which it arrived.
        said_hello: whether a `hello` came before it on the connection. Until then `id` is not known
            [NEG-27], and a pose may spell its numbers as strings [JSN-11].

    Raises:
        ProtocolError: `malformed_json`, `not_an_object`, `invalid_number`, `invalid_rotation`,
            `invalid_message`, and `unknown_type` for a message that is to be ignored [REQ-8,
            NEG-9].
    """
    if channel == "message" and (pose := plain_pose(payload)) is not None:
        return pose
    message = Field(parse_object(payload), "", "")
    match channel, message.value.get("type"):
        case "message", "camera_pose":
            return CameraPose(*_pose_and_timestamp(message, or_strings=not said_hello))
        case "message", "point_cloud_pose":
            return PointCloudPose(*_pose_and_timestamp(message, or_strings=not said_hello))
        case "message", "get_viewport_size":
            return GetViewportSize(
                _id(message.under("NEG-27")) if said_hello else None, _timestamp(message)
            )
        case "message", "get_camera_pose":
            cam_idx = message.under("REQ-2").member("cam_idx")
            return GetCameraPose(
                cam_idx.integer(-MAX_SAFE_INTEGER, MAX_SAFE_INTEGER),
                _id(message.under("NEG-27")) if said_hello else None,
                _timestamp(message),
            )
        case _, "hello":
            return _hello(message.under("NEG-2"))
        case "ipc", "opened":
            return Opened(_generation(message.under("OPN-13")))
        case "ipc", "open_failed":
            reason = message.under("OPN-13").member("reason").under("OPN-3")
            return OpenFailed(
                _generation(message.under("OPN-13")), reason.string(1, LIMITS["max_reason_chars"])
            )
        case "ipc", "closed":
            return Closed(_generation(message.under("OPN-13")))
        case "ipc", "release":
            return Release(_generation(message.under("IMG-12")), _seq(message.under("IMG-12")))
        case "ipc", "subscribe":
            return _subscribe(message.under("IMG-19"))
    raise _unknown_type(message, "NEG-9" if said_hello or channel == "ipc" else "REQ-8")


def decode_from_server_ipc(payload: bytes) -> InitPacket | Welcome | Frame | ErrorMessage:
    """Return the message that a server sent on the IPC channel.

    Raises:
        ProtocolError: as `decode_from_client`, with `unknown_type` also for an object that is no
            init packet [INI-11]. See `readable_generation` for what to answer to a bad init packet.
    """
    message = Field(parse_object(payload), "", "")
    match message.value.get("type"):
        case "welcome":
            return _welcome(message)
        case "error":
            return _error(message.under("NEG-23"))
        case "frame":
            return _frame(message.under("IMG-1"))
    if is_init_packet(message.value):
        return parse_init_packet(message.value)
    raise _unknown_type(message, "INI-11")


def decode_from_server_message(
    payload: bytes, request: Request | None
) -> ViewportSize | CameraReply | Welcome | ErrorMessage:
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
    reply: ViewportSize | CameraReply
    match kind:
        case "welcome":
            return _welcome(message)
        case "error":
            return _error(message.under("NEG-23"))
        case "viewport_size":
            reply = _viewport_size(message)
        case "camera":
            reply = _camera(message)
        case _ if typed:
            raise _unknown_type(message, "NEG-9")
    if request is None:
        raise message.refused("answers no request", "unknown_type")
    if kind != _reply_type(request):
        raise message.under("REQ-7").refused(f"is a {kind}, which the oldest request is not for")
    if typed and reply.id != request.id:
        raise Field(reply.id, "/id", "NEG-28").refused(f"is {reply.id}, not {request.id}")
    return reply


def _pose_and_timestamp(message: Field, *, or_strings: bool) -> tuple[Pose, float | None]:
    pose = object_pose(message.under("POS-1"), or_strings=or_strings)
    return pose, _timestamp(message, or_string=or_strings)


def _timestamp(message: Field, *, or_string: bool = False) -> float | None:
    timestamp = message.under("POS-8").optional("timestamp")
    return None if timestamp is None else timestamp.number(or_string=or_string)


def _id(message: Field) -> int | None:
    identifier = message.optional("id")
    return None if identifier is None else identifier.integer(0, MAX_SAFE_INTEGER)


def _generation(message: Field) -> int:
    return message.member("generation").integer(1, MAX_SAFE_INTEGER)


def _seq(message: Field) -> int:
    return message.member("seq").integer(0, MAX_SAFE_INTEGER)


def _hello(hello: Field) -> Hello:
    token = hello.optional("token")
    return Hello(
        tuple(map(_version, hello.member("versions").items(1, LIMITS["max_versions"]))),
        _program(hello.member("client")),
        _capabilities(hello.member("capabilities")),
        None if token is None else token.string(1, LIMITS["max_token_chars"]),
    )


def _welcome(message: Field) -> Welcome:
    welcome = message.under("NEG-30")
    return Welcome(
        _version(welcome.member("version")),
        _program(welcome.member("server")),
        _capabilities(welcome.member("capabilities")),
    )


def _version(version: Field) -> str:
    version.string(1, _MAX_NAME_CHARS)
    return version.matching(_VERSION, "two decimal integers joined by a dot")


def _program(program: Field) -> Program:
    name, version = program.member("name"), program.member("version")
    return Program(name.string(0, _MAX_NAME_CHARS), version.string(0, _MAX_NAME_CHARS))


def _capabilities(capabilities: Field) -> tuple[str, ...]:
    items = capabilities.items(0, LIMITS["max_capabilities"])
    return _different(capabilities, [item.string(0, _MAX_NAME_CHARS) for item in items])


def _different(array: Field, values: list[str]) -> tuple[str, ...]:
    if len(set(values)) != len(values):
        raise array.refused("names one of its items twice")
    return tuple(values)


def _error(error: Field) -> ErrorMessage:
    # Any code and any pointer is taken: an error that breaks a rule still says something [NEG-24].
    pointer = error.optional("pointer")
    supported = error.under("NEG-10").optional("supported")
    return ErrorMessage(
        error.member("code").string(1, LIMITS["max_message_chars"]),
        error.member("message").string(0, LIMITS["max_message_chars"]),
        _id(error),
        None if pointer is None else pointer.string(0, MAX_SAFE_INTEGER),
        None if supported is None else tuple(map(_version, supported.items(1))),
    )


def _subscribe(subscribe: Field) -> Subscribe:
    channels = subscribe.member("channels")
    return Subscribe(
        frozenset(_different(channels, [item.one_of(_CHANNELS) for item in channels.items(1, 2)]))
    )


def _frame(frame: Field) -> Frame:
    return Frame(
        _generation(frame),
        _seq(frame),
        frame.member("slot").integer(0, LIMITS["max_slots"] - 1),
        _frame_camera(frame.member("camera")),
        frame.member("time").number(),
        frame.member("renderedAt").number(),
    )


def _frame_camera(camera: Field) -> FrameCamera:
    near, far = camera.member("near").positive(), camera.member("far").positive()
    if not near < far:
        raise camera.member("far").refused(f"is {far}, not greater than near, {near}")
    return FrameCamera(
        array_pose(camera),
        camera.member("fx").positive(),
        camera.member("fy").positive(),
        camera.member("cx").number(),
        camera.member("cy").number(),
        camera.member("width").integer(1, _MAX_IMAGE_SIZE),
        camera.member("height").integer(1, _MAX_IMAGE_SIZE),
        near,
        far,
    )


def _reply_type(request: Request | None) -> str | None:
    if request is None:
        return None
    return "viewport_size" if isinstance(request, GetViewportSize) else "camera"


def _viewport_size(message: Field) -> ViewportSize:
    size = message.under("REQ-3").member("viewport_size")
    width, height = (item.integer(0, _MAX_IMAGE_SIZE) for item in size.items(2, 2))
    return ViewportSize(width, height, _reply_id(message))


def _camera(message: Field) -> CameraReply:
    return CameraReply(array_pose(message.under("REQ-5")), _reply_id(message))


def _reply_id(message: Field) -> int | None:
    # Without `type` it is a reply of 1.0, which knows no `id` [JSN-7].
    return _id(message.under("NEG-28")) if "type" in message.value else None


def _unknown_type(message: Field, requirement: str) -> ProtocolError:
    kind = Field(message.value.get("type"), "/type", requirement)
    if "type" not in message.value:
        return kind.refused("is missing", "unknown_type")
    return kind.refused(f"is {brief(kind.value)}, which is not known here", "unknown_type")
