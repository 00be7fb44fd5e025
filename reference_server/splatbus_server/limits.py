"""What clients may take of a server, all together."""

from __future__ import annotations

from typing import NamedTuple


class Limits(NamedTuple):
    """Set by whoever starts the server.

    Attributes:
        connections: on each channel at a time [LIM-1].
        pixels: of images of a size that a client asks for; the renderer's own may be larger.
        share: of the memory that is free, 0 to 1, that images of a size that a client asks for may
            take.
    """

    connections: int = 8
    pixels: int = 3840 * 2160
    share: float = 0.5


DEFAULT = Limits()
