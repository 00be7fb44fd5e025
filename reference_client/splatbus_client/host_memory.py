"""Images in named shared memory of the host, only read and never removed [OPN-10, MEM-19]."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.errors import ProtocolError
from splatbus_wire.init_packet import HostMemory, InitPacket, Slots
from splatbus_wire.semantics import Semantics

from splatbus_client.mapping import MemoryLostError, extent, map_memory, read

Image = NDArray[np.float32]
APART = "client and server have to be on one machine"
if sys.platform == "linux":
    APART += "; in containers, with --ipc=host or one /dev/shm"


class CannotOpenError(Exception):
    """What a valid init packet names cannot be opened here, and why [INI-13, OPN-4]."""


class HostImages:
    """The ring of one init packet, mapped.

    Args:
        packet: a valid init packet.

    Raises:
        CannotOpenError: it names no host memory, or the memory is missing, forbidden or too small.
    """

    def __init__(self, packet: InitPacket) -> None:
        memory, ring, semantics = packet.memory, packet.ring, packet.semantics
        if not isinstance(memory, HostMemory) or ring is None or semantics is None:
            raise CannotOpenError("they are in CUDA memory, and this client has no CUDA support")
        self.generation = packet.generation or 0
        self.semantics: Semantics = semantics
        self.ring: Slots = ring
        self.size = packet.width, packet.height
        self._name, self._extent = memory.name, extent(packet)
        try:
            self.map = map_memory(memory, packet)
        except FileNotFoundError:
            raise CannotOpenError(f"there is no shared memory {memory.name}: {APART}") from None
        except PermissionError as problem:
            told = f"shared memory {memory.name}: {problem.strerror}"
            raise CannotOpenError(f"{told}: client and server have to be one user's") from None
        except ProtocolError as problem:
            raise CannotOpenError(str(problem)) from None
        except (OSError, ValueError) as problem:
            raise CannotOpenError(f"shared memory {memory.name}: {problem}") from problem

    def color(self, slot: int) -> Image:
        """Return (h, w, 4) float32, RGBA, rows top-down: a view of the memory [BUF-1]."""
        rows = self._rows(self.ring.color_offset + slot * self.ring.color_stride, 4)
        return rows[::-1]

    def depth(self, slot: int) -> Image:
        """Return (h, w) float32, rows top-down: a view of the memory [BUF-1]."""
        rows = self._rows(self.ring.depth_offset + slot * self.ring.depth_stride, 1)
        return rows[::-1, :, 0]

    def on_host(self, name: str, slot: int, image: Image) -> Image:
        """Return the image as it is: it is on the host."""
        return image

    def copied(self, name: str, slot: int, image: Image) -> Image:
        """Return a copy of what `color` or `depth` returned, with no risk to the process.

        Raises:
            MemoryLostError: the memory became shorter meanwhile.
        """
        least = min(image[0].ctypes.data, image[-1].ctypes.data)
        begin = least - np.frombuffer(self.map, np.uint8, 1).ctypes.data
        if not 0 <= begin <= self._extent - image.nbytes:
            return image.copy()  # it is no view of the memory
        try:
            data = read(self.map, begin, image.nbytes)
        except MemoryLostError as problem:
            raise MemoryLostError(self.lost() or str(problem)) from None
        first = image.ctypes.data - least
        return np.ndarray(image.shape, image.dtype, data, first, image.strides)

    def lost(self) -> str | None:
        """Return why nothing may be read any more, None if all is there: asks the system, in µs."""
        size = self.map.size()
        if size >= self._extent:
            return None
        lost = f"was cut to {size} bytes, {self._extent} hold images"
        return f"shared memory {self._name} {lost} [MEM-5]"

    def finish(self, slot: int) -> None:
        """Do nothing: reads of memory of the host are over when they return."""

    def close(self) -> bool:
        """Unmap, and return True; or False while somebody still keeps an array of it."""
        try:
            self.map.close()
        except BufferError:
            return False
        return True

    def _rows(self, offset: int, numbers: int) -> Image:
        """The rows from a byte on as they lie in memory, so many numbers a pixel."""
        width, height = self.size
        flat = np.frombuffer(self.map, np.dtype("<f4"), width * height * numbers, offset)
        return flat.reshape(height, width, numbers)
