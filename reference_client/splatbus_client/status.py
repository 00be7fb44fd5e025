"""How a session fares, and in words why something did not come."""

from __future__ import annotations

from typing import NamedTuple

from splatbus_wire.settings import Settings

from splatbus_client.channel import ChannelStatus


class Status(NamedTuple):
    """How both channels fare, and what else stands in the way.

    Attributes:
        ipc: the channel of the images.
        message: the channel of poses and questions.
        no_images: why there are no images where the server announced some.
        no_effect: why what was sent last has no effect, where that is known: another client has
            control, or the server does not offer a capability. The former ends when an image
            comes back with a tag of ours [CAM-2], and with the connection.
    """

    ipc: ChannelStatus
    message: ChannelStatus
    no_images: str | None
    no_effect: str | None = None


def why_no_frame(status: Status, where: Settings, *, announced: bool) -> str:
    """Why no frame came; `announced` tells whether there is memory to read from."""
    if not status.ipc.connected:
        return _why_not_connected(status.ipc, where)
    if status.no_images is not None:
        return f"the images cannot be opened: {status.no_images}"
    if not announced:
        return "the server has announced no images yet: it may still be starting"
    return "the server has published no other image"


def why_no_reply(status: Status, where: Settings) -> str:
    """Why nothing came on the message channel."""
    if not status.message.connected:
        return _why_not_connected(status.message, where)
    return "the server has not answered, or does not know yet"


def _why_not_connected(channel: ChannelStatus, where: Settings) -> str:
    return (
        f"no server at {where.address()}: {channel.problem or 'connecting'}."
        " Start one with: splatbus-server"
    )
