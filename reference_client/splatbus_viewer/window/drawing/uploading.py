"""Textures that take each image: from memory of the host one upload through a buffer object."""

from __future__ import annotations

from typing import Any, Protocol

import moderngl
import numpy as np
from splatbus_client.lease import FrameLease

CHANNELS = {"color": 4, "depth": 1}
"""Float32 numbers a pixel."""


class Textures(Protocol):
    """Textures of one size, which take images from one kind of memory."""

    color: moderngl.Texture
    depth: moderngl.Texture

    def take(self, lease: FrameLease) -> int:
        """Take what an image has, and return how many bytes were copied."""

    def release(self) -> None:
        """Give back what they take of the GPU."""


def texture(context: moderngl.Context, width: int, height: int, name: str) -> moderngl.Texture:
    """Return a float32 texture for `"color"` or `"depth"`, zero at first: nothing is there."""
    numbers = CHANNELS[name]
    zeros = bytes(4 * numbers * width * height)
    made = context.texture((width, height), numbers, zeros, dtype="f4")
    made.filter = moderngl.NEAREST, moderngl.NEAREST
    return made


class Uploads:
    """Textures that are uploaded to; the bottom row comes first in memory as in OpenGL [BUF-1]."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        self.color = texture(context, width, height, "color")
        self.depth = texture(context, width, height, "depth")
        self._context = context
        self._buffers: dict[str, moderngl.Buffer] = {}

    def take(self, lease: FrameLease) -> int:
        """Upload the channels that are subscribed to; returns how many bytes."""
        copied = 0
        for name in sorted(lease.channels):
            rows: Any = (lease.color if name == "color" else lease.depth)[::-1]
            rows = np.ascontiguousarray(rows)  # as it lies there; no copy
            if name not in self._buffers:
                self._buffers[name] = self._context.buffer(reserve=rows.nbytes, dynamic=True)
            buffer = self._buffers[name]
            buffer.orphan()  # the driver may still read the former image
            buffer.write(rows)
            getattr(self, name).write(buffer)
            copied += rows.nbytes
        return copied

    def release(self) -> None:
        """Give back textures and buffers."""
        self.color.release()
        self.depth.release()
        for buffer in self._buffers.values():
            buffer.release()
