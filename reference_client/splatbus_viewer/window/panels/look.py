"""What the panels look at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from splatbus_client.session import Session
from splatbus_wire.messages import FrameCamera

from splatbus_viewer.window.choices import Choices
from splatbus_viewer.window.conversation import Conversation
from splatbus_viewer.window.packets import Packets


@dataclass
class Look:
    """All that panels show; of it, they change `choices`, `packets` and what is their own.

    Attributes:
        now: seconds on the client's clock.
        seconds: since the interface was described last.
        camera: of the image that is shown; None before the first.
        size: of the image, pixels.
        trouble: why there is no image, in words, and what to do; None while there is one.
        screenshot: takes a picture of what is shown once it is drawn; returns where.
        saved: where the last screenshot went.
        own: what a panel remembers, by its name.
    """

    session: Session
    choices: Choices
    conversation: Conversation
    packets: Packets
    screenshot: Callable[[], None]
    now: float = 0.0
    seconds: float = 0.0
    camera: FrameCamera | None = None
    size: tuple[int, int] = (0, 0)
    trouble: str | None = None
    saved: str | None = None
    own: dict[str, Any] = field(default_factory=dict)
