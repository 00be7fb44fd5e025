"""Targets: what packets and messages are made of."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from splatbus_wire import from_client, from_server
from splatbus_wire.decoding import MAX_CLIENT_VALUES
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.fields import Field
from splatbus_wire.framing import PacketDecoder
from splatbus_wire.init_packet import readable_generation
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import (
    Channel,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Message,
    Ping,
    Request,
    SetViewport,
    Telemetry,
    decode_from_client,
    decode_from_server_ipc,
    decode_from_server_message,
    encode,
)
from splatbus_wire.plain_frames import plain_frame
from splatbus_wire.plain_poses import plain_pose

Decode = Callable[[bytes], Any]
REQUESTS: tuple[Request | None, ...] = (
    None,
    GetViewportSize(7),
    GetCameraPose(1, 7),
    GetScene(7),
    SetViewport(640, 480, 7),
    Ping(1.0, 7),
)
HEADER = 4
STEPS = (1, 7, 64)
"""Sizes of pieces that a stream is cut into; bytes where it is short."""
SHORT_BYTES = 300


def framing(data: bytes) -> None:
    """However a stream is divided, the same packets come of it, and the same error [FRM-4]."""
    whole = _packets([data])
    for size in STEPS if len(data) <= SHORT_BYTES else STEPS[1:]:
        pieces = [data[at : at + size] for at in range(0, len(data), size)]
        assert _packets(pieces) == whole, size


def _packets(pieces: list[bytes]) -> tuple[list[bytes], int | None]:
    decoder, found = PacketDecoder(), []
    try:
        for piece in pieces:
            decoder.receive(piece)
            while (payload := decoder.next_packet()) is not None:
                found.append(payload)
    except FramingError as error:
        return found, error.offset
    return found, None


def client_on_ipc(payload: bytes) -> None:
    """What a client sends on the IPC channel."""
    for said_hello in (False, True):
        _there_and_back(payload, partial(_from_client, "ipc", said_hello))


def client_on_message(payload: bytes) -> None:
    """What a client sends on the message channel; a pose read the short way is as the long way."""
    for said_hello in (False, True):
        _there_and_back(payload, partial(_from_client, "msg", said_hello))
    if (pose := plain_pose(payload)) is not None:
        message = Field(parse_object(payload, MAX_CLIENT_VALUES), "", "")
        careful = from_client.on_message_channel(message.value["type"], message)
        assert pose == careful


def server_on_ipc(payload: bytes) -> None:
    """What a server sends on the IPC channel; a frame read the short way is as the long way."""
    _there_and_back(payload, decode_from_server_ipc)
    if (frame := plain_frame(payload)) is not None:
        assert frame == from_server.frame(Field(parse_object(payload), "", "IMG-1"))
    with suppress(ProtocolError):
        readable_generation(parse_object(payload))


def server_on_message(payload: bytes) -> None:
    """What a server sends on the message channel, to each request."""
    for request in REQUESTS:
        _there_and_back(payload, partial(_from_server, request))


def _from_client(channel: Channel, said_hello: bool, payload: bytes) -> Message:
    return decode_from_client(payload, channel, said_hello=said_hello)


def _from_server(request: Request | None, payload: bytes) -> Message:
    return decode_from_server_message(payload, request)


def _there_and_back(payload: bytes, decode: Decode) -> None:
    """What was decoded is the same after it was encoded and decoded once more."""
    try:
        message: Message = decode(payload)
    except ProtocolError:
        return
    if isinstance(message, Telemetry) and not message.series:
        return  # all were of kinds that are not known here, and a message without any is none
    again = encode(message, typed_replies=_is_typed(payload))[HEADER:]
    assert decode(again) == message, again


def _is_typed(payload: bytes) -> bool:
    return "type" in parse_object(payload)
