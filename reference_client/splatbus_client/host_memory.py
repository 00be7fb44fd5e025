"""Named shared memory of the host, mapped for reading only and never removed [OPN-10]."""

import mmap
import os
import stat
import sys

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.errors import ProtocolError
from splatbus_wire.init_packet import HostMemory, InitPacket, Semantics, Slots, check_fits

Image = NDArray[np.float32]


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
        try:
            self.map = map_memory(memory, packet)
        except FileNotFoundError:
            raise CannotOpenError(f"there is no shared memory {memory.name}") from None
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


if sys.platform == "win32":
    from multiprocessing.shared_memory import SharedMemory

    def map_memory(memory: HostMemory, packet: InitPacket) -> mmap.mmap:
        """Map an existing named mapping; `mmap` alone would create one that does not exist."""
        name = f"Local\\{memory.name}"
        existing = SharedMemory(name)
        try:
            check_fits(packet, existing.size)
            return mmap.mmap(-1, memory.bytes, tagname=name, access=mmap.ACCESS_READ)
        finally:
            existing.close()

else:

    def map_memory(memory: HostMemory, packet: InitPacket) -> mmap.mmap:
        """Map an object of `shm_open`, whose size is checked before a byte is touched [MEM-6]."""
        descriptor = _shm_open(memory.name)
        try:
            status = os.fstat(descriptor)
            if sys.platform == "linux" and not stat.S_ISREG(status.st_mode):
                raise OSError("it is no regular file")
            check_fits(packet, status.st_size)
            # Its pages are mapped now rather than one by one while the first images are read.
            flags = mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0)
            return mmap.mmap(descriptor, memory.bytes, flags, mmap.PROT_READ)
        finally:
            os.close(descriptor)

    def _shm_open(name: str) -> int:
        if sys.platform == "linux":
            # The flags of the C library's shm_open: no link is followed, no pipe waited for.
            flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
            return os.open(f"/dev/shm/{name}", flags)
        # `SharedMemory` would hand the memory to a tracker that removes it when we exit.
        import _posixshmem  # type: ignore[import-not-found]

        descriptor: int = _posixshmem.shm_open(f"/{name}", os.O_RDONLY, 0o600)
        return descriptor
