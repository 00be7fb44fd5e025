"""Shared memory by its name: opened for reading, mapped as far as images lie in it, and no further.

A server that is hostile, or has crashed, may name what is no memory of images, announce far more
than it uses, and cut memory short while it is read.
"""

from __future__ import annotations

import errno
import mmap
import os
import stat
import sys
import weakref
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.init_packet import (
    COLOR_PIXEL_BYTES,
    DEPTH_PIXEL_BYTES,
    HostMemory,
    InitPacket,
    check_fits,
)

Bytes = NDArray[np.uint8]
_BLOCK_BYTES = 512
"""What `st_blocks` counts in, whatever the file system."""


class MemoryLostError(OSError):
    """Memory that was opened became shorter: what was to be read is not there any more [MEM-5]."""


def extent(packet: InitPacket) -> int:
    """How many bytes, from the first one of the memory on, the images of a ring reach over."""
    ring, pixels = packet.ring, packet.width * packet.height
    assert ring is not None
    last = ring.slots - 1
    return max(
        ring.color_offset + last * ring.color_stride + COLOR_PIXEL_BYTES * pixels,
        ring.depth_offset + last * ring.depth_stride + DEPTH_PIXEL_BYTES * pixels,
    )


if sys.platform == "win32":
    from multiprocessing.shared_memory import SharedMemory

    def map_memory(memory: HostMemory, packet: InitPacket) -> mmap.mmap:
        """Map an existing named mapping; `mmap` alone would create one that does not exist."""
        name = f"Local\\{memory.name}"
        existing = SharedMemory(name)
        try:
            check_fits(packet, existing.size)
            return mmap.mmap(-1, extent(packet), tagname=name, access=mmap.ACCESS_READ)
        finally:
            existing.close()

    def read(mapping: mmap.mmap, begin: int, size: int) -> Bytes:
        """Return a copy of so many bytes; a named mapping keeps its size as long as it lives."""
        return np.frombuffer(mapping, np.uint8, size, begin).copy()

else:

    class ReadableMap(mmap.mmap):
        """A mapping, and a descriptor by which the same memory is read without risk.

        To touch a page that was cut off is a signal, which kills; to read it is an end of file.
        """

        def keep(self, descriptor: int) -> None:
            """Own a descriptor of what is mapped, until `close` or the end of the mapping."""
            self.descriptor = descriptor
            self._close_descriptor = weakref.finalize(self, os.close, descriptor)

        def close(self) -> None:
            """Unmap, and close the descriptor; BufferError while there are arrays of it."""
            super().close()
            self._close_descriptor()

    def map_memory(memory: HostMemory, packet: InitPacket) -> mmap.mmap:
        """Map an object of `shm_open`, whose size is checked before a byte is touched [MEM-6].

        Raises:
            OSError: it cannot be opened, or is nothing that a server of this user shares.
            ProtocolError: as `check_fits`.
        """
        descriptor = _shm_open(memory.name)
        try:
            status = os.fstat(descriptor)
            _check_is_ours(status)
            check_fits(packet, status.st_size)
            flags = mmap.MAP_SHARED | _populated(packet, status)
            if sys.platform != "linux":  # where it keeps its size, and is read by mappings alone
                return mmap.mmap(descriptor, extent(packet), flags, mmap.PROT_READ)
            mapping = ReadableMap(descriptor, extent(packet), flags, mmap.PROT_READ)
            mapping.keep(os.dup(descriptor))
            return mapping
        finally:
            os.close(descriptor)

    def read(mapping: mmap.mmap, begin: int, size: int) -> Bytes:
        """Return a copy of so many bytes.

        Raises:
            MemoryLostError: they are not there any more.
        """
        if not isinstance(mapping, ReadableMap):
            return np.frombuffer(mapping, np.uint8, size, begin).copy()
        data = np.empty(size, np.uint8)
        done = 0
        while done < size:
            count = os.preadv(mapping.descriptor, [data.data[done:]], begin + done)
            if not count:
                raise MemoryLostError(f"it ends at byte {begin + done} [MEM-5]")
            done += count
        return data

    def _check_is_ours(status: os.stat_result) -> None:
        if sys.platform == "linux" and not stat.S_ISREG(status.st_mode):
            raise OSError("it is no regular file")
        # What MEM-4 has a server make, nobody but its user and root can open. Another user's memory
        # that we can open is none of a server that conforms, and that user can cut it short.
        if os.geteuid() not in (status.st_uid, 0):
            raise _anothers(status)

    def _anothers(status: os.stat_result) -> PermissionError:
        told = f"it belongs to user {status.st_uid}, and this is {os.geteuid()} [MEM-4]"
        return PermissionError(errno.EACCES, told)

    def _populated(packet: InitPacket, status: os.stat_result) -> int:
        """The flag that has pages mapped now rather than one by one while images are read.

        Not where they are mostly no images', nor where they would have to be made for it.
        """
        assert packet.ring is not None
        slot_bytes = (COLOR_PIXEL_BYTES + DEPTH_PIXEL_BYTES) * packet.width * packet.height
        most = min(2 * packet.ring.slots * slot_bytes, _BLOCK_BYTES * status.st_blocks)
        return getattr(mmap, "MAP_POPULATE", 0) if extent(packet) <= most else 0

    def _shm_open(name: str) -> int:
        if sys.platform == "linux":
            if name.startswith("sem."):
                raise OSError("it is a semaphore by its name")  # of sem_open, in the same folder
            # The flags of the C library's shm_open: no link is followed, no pipe waited for.
            flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
            path = Path("/dev/shm", name)
            try:
                return os.open(path, flags)
            except PermissionError:
                raise _anothers(path.stat()) from None
        # `SharedMemory` would hand the memory to a tracker that removes it when we exit.
        import _posixshmem  # type: ignore[import-not-found]

        descriptor: int = _posixshmem.shm_open(f"/{name}", os.O_RDONLY, 0o600)
        return descriptor
