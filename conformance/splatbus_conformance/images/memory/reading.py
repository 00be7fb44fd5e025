"""Memory that a server announces, opened for reading: the judge's own, small reading of MEM-4.

The testee is not trusted: whatever is announced is checked before a byte of memory is touched.
"""

import mmap
import os
import stat
import sys
from multiprocessing import shared_memory
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.wire.json_values import whole, within
from splatbus_conformance.wire.messages import Json

LINUX_FOLDER = Path("/dev/shm")
MOST_BYTES = 2**34
MOST_PIXELS = 2**26

Pixels = NDArray[np.float32]


class CannotOpen(Exception):  # noqa: N818 - a finding, no error of ours
    """What was announced cannot be opened here; the message says why."""


class RingLayout(NamedTuple):
    """Where the images of a ring lie: sizes in pixels, offsets and strides in bytes."""

    width: int
    height: int
    slots: int
    color_offset: int
    color_stride: int
    depth_offset: int
    depth_stride: int
    bytes: int


class Opened:
    """Shared memory of a server, mapped for reading."""

    def __init__(self, generation: int, name: str, layout: RingLayout) -> None:
        self.generation = generation
        self.name = name
        self.layout = layout
        self._file, self._view = _map(name, layout.bytes)

    def color(self, slot: int) -> Pixels:
        """A copy of the colour in a slot: (h, w, 4) float32, rows top-down (BUF-1)."""
        at = self.layout.color_offset + slot * self.layout.color_stride
        return self._copy(slot, at, 4)

    def depth(self, slot: int) -> Pixels:
        """A copy of the depth in a slot: (h, w) float32, rows top-down."""
        at = self.layout.depth_offset + slot * self.layout.depth_stride
        return self._copy(slot, at, 1)[:, :, 0]

    def size(self) -> int | None:
        """How many bytes the memory has now, where that is shown."""
        return None if self._file is None else os.fstat(self._file).st_size

    def mode(self) -> int | None:
        """Who may open it, as permission bits, where that is shown."""
        return None if self._file is None else stat.S_IMODE(os.fstat(self._file).st_mode)

    def close(self) -> None:
        """Unmap."""
        self._view.close()
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _copy(self, slot: int, offset: int, numbers: int) -> Pixels:
        width, height = self.layout.width, self.layout.height
        data = self._read(slot, offset, 4 * numbers * width * height)
        flat = np.frombuffer(data, np.dtype("<f4"))
        return flat.reshape(height, width, numbers)[::-1]

    def _read(self, slot: int, offset: int, size: int) -> bytes:
        return self._view[offset : offset + size]


def open_memory(init_packet: Json) -> Opened:
    """Open the `host_shm` memory of a 1.1 init packet. Raises CannotOpen."""
    memory = init_packet.get("memory")
    if not isinstance(memory, dict) or memory.get("kind") != "host_shm":
        raise CannotOpen("it announces no memory of the host")
    name, generation = memory.get("name"), whole(init_packet.get("generation"), 1)
    if not isinstance(name, str) or not name or "/" in name or "\0" in name:
        raise CannotOpen("memory.name is no name")
    if generation is None:
        raise CannotOpen("generation is no positive integer")
    layout = layout_of(init_packet)
    try:
        return Opened(generation, name, layout)
    except (OSError, ValueError) as error:
        raise CannotOpen(f"shared memory {name}: {error}") from None


def layout_of(init_packet: Json) -> RingLayout:
    """The layout that a 1.1 init packet announces. Raises CannotOpen where it fits no memory."""
    numbers = [
        _number(init_packet, *path)
        for path in (
            *(("meta", "w"), ("meta", "h"), ("ring", "slots")),
            *(("ring", "colorOffset"), ("ring", "colorStride")),
            *(("ring", "depthOffset"), ("ring", "depthStride"), ("memory", "bytes")),
        )
    ]
    layout = RingLayout(*numbers)
    w, h, slots, color, color_stride, depth, depth_stride, size = layout
    if not (1 <= w * h <= MOST_PIXELS and slots >= 1 and size <= MOST_BYTES):
        raise CannotOpen("its sizes are out of bounds")
    ends = (
        color + (slots - 1) * color_stride + 16 * w * h,
        depth + (slots - 1) * depth_stride + 4 * w * h,
    )
    if max(ends) > size:
        raise CannotOpen(f"its images need {max(ends)} bytes of {size}")
    return layout


def _number(init_packet: Json, *path: str) -> int:
    number = whole(within(init_packet, *path), 0)
    if number is None:
        raise CannotOpen(f"/{'/'.join(path)} is no integer from 0")
    return number


def _map(name: str, size: int) -> tuple[int | None, mmap.mmap]:
    if sys.platform == "linux":
        flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        file = os.open(LINUX_FOLDER / name, flags)
        status = os.fstat(file)
        if not stat.S_ISREG(status.st_mode) or status.st_size < size:
            os.close(file)
            raise OSError(f"it has {status.st_size} bytes, not {size}")
        return file, mmap.mmap(file, size, prot=mmap.PROT_READ)
    if sys.platform == "win32":
        shared_memory.SharedMemory(f"Local\\{name}").close()  # mmap would create what is missing
        return None, mmap.mmap(-1, size, tagname=f"Local\\{name}", access=mmap.ACCESS_READ)
    import _posixshmem  # type: ignore[import-not-found]

    file = _posixshmem.shm_open(f"/{name}", os.O_RDONLY, 0o600)
    return file, mmap.mmap(file, size, prot=mmap.PROT_READ)
