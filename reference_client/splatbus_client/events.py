"""What a connection's protocol machine tells its owner."""

from __future__ import annotations

from typing import NamedTuple, Union

from splatbus_wire.init_packet import InitPacket
from splatbus_wire.messages import (
    CameraReply,
    ErrorMessage,
    Frame,
    Hello,
    Program,
    Scene,
    Telemetry,
    ViewportSize,
    Welcome,
)

from splatbus_client.clock import Sample

Answer = Union[ViewportSize, CameraReply, Scene, Sample]
"""What a request is answered with; a ping with when it was sent, and its pong received."""


class Negotiated(NamedTuple):
    """It is known what the server speaks.

    Attributes:
        version: `"1.0"` or `"1.1"`.
        server: what it calls itself; None where it did not say (1.0).
        capabilities: of this channel, those that both sides have.
    """

    version: str
    server: Program | None
    capabilities: frozenset[str]


def negotiated(hello: Hello, welcome: Welcome) -> Negotiated:
    """Return what was agreed: nothing that was not offered, and 1.0 knows no capabilities."""
    common = frozenset(welcome.capabilities) & frozenset(hello.capabilities)
    agreed = common if welcome.version == "1.1" else frozenset()
    return Negotiated(welcome.version, welcome.server, agreed)


class Announced(NamedTuple):
    """A valid init packet is to be opened, and answered by `opened` or `open_failed` [OPN-1]."""

    packet: InitPacket


class Declined(NamedTuple):
    """An init packet that breaks a rule was answered by `open_failed`; the former one is over."""

    generation: int
    reason: str


class Lent(NamedTuple):
    """A slot may be read until it is released.

    Attributes:
        frame: which slot, and what it was rendered with.
        channels: which of `"color"` and `"depth"` may be read [IMG-22].
    """

    frame: Frame
    channels: frozenset[str]


class Look(NamedTuple):
    """It is time to look at the buffers of 1.0: nobody announces what comes into them."""


class Replied(NamedTuple):
    """A request was answered; `ticket` is what `ask` returned."""

    ticket: int
    answer: Answer


class Refused(NamedTuple):
    """A request was answered with an error; `ticket` is what `ask` returned."""

    ticket: int
    error: ErrorMessage


class NotOffered(NamedTuple):
    """A request cannot be sent, because the server lacks a capability [NEG-5]."""

    ticket: int
    capability: str


class Measured(NamedTuple):
    """The server sends figures that were subscribed to, in a packet of `size` bytes."""

    telemetry: Telemetry
    size: int


class ServerError(NamedTuple):
    """The server reports an error that answers no request."""

    error: ErrorMessage


class Ignored(NamedTuple):
    """A packet was ignored; the connection goes on as if it had not come."""

    reason: str


class MustClose(NamedTuple):
    """The connection has to be closed; nothing that follows on it counts."""

    reason: str


IpcEvent = Union[Negotiated, Announced, Declined, Lent, Look, ServerError, Ignored, MustClose]
MessageEvent = Union[
    Negotiated, Replied, Refused, NotOffered, Measured, ServerError, Ignored, MustClose
]
Event = Union[IpcEvent, MessageEvent]
