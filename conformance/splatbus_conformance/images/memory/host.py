"""Shared memory that the harness announces to a testee: the judge's own, small reading of MEM-4."""

import contextlib
import hashlib
import mmap
import os
import secrets
import sys
from multiprocessing import resource_tracker, shared_memory
from typing import Self

from splatbus_conformance import guard
from splatbus_conformance.guard import Kind, uninterrupted
from splatbus_conformance.images.memory.reading import LINUX_FOLDER

PREFIX = "splatbus-check-"


def free_bytes() -> int | None:
    """How much shared memory is left, where that is known; None where there is none."""
    if sys.platform != "linux":
        return None
    with contextlib.suppress(OSError):
        left = os.statvfs(LINUX_FOLDER)
        return left.f_bavail * left.f_frsize
    return None


def _reserve(file: int, size: int) -> None:
    """Have all pages now: where there are too few, whoever touches one too many is killed."""
    if size and sys.platform == "linux":
        os.posix_fallocate(file, 0, size)


class HostMemory:
    """A named piece of shared memory of `size` bytes, filled with zeros; owned by the harness.

    A check that needs an odd name gives one; OSError where the system has no such names, or too
    little memory. One that is sparse has the pages alone that are written, on Linux.
    """

    def __init__(self, size: int, name: str | None = None, *, sparse: bool = False) -> None:
        self.name = name or f"{PREFIX}{secrets.token_hex(6)}"
        self.size = size
        self._file: int | None = None
        self._shared: shared_memory.SharedMemory | None = None
        if sys.platform == "linux":
            import fcntl

            flags = os.O_CREAT | os.O_EXCL | os.O_RDWR
            with uninterrupted():
                self._file = os.open(LINUX_FOLDER / self.name, flags, 0o600)
                guard.watch(Kind.PATH, LINUX_FOLDER / self.name)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            try:
                os.ftruncate(self._file, size)
                if not sparse:
                    _reserve(self._file, size)
            except OSError:
                os.close(self._file)
                self._remove()
                raise
            self._map: mmap.mmap | None = mmap.mmap(self._file, size) if size else None
        elif sys.platform == "win32":
            self._map = mmap.mmap(-1, size, tagname=f"Local\\{self.name}")
        else:
            self._map = None
            self._shared = shared_memory.SharedMemory(self.name, create=True, size=size)
            with contextlib.suppress(Exception):
                resource_tracker.unregister(f"/{self.name}", "shared_memory")

    def write(self, offset: int, data: bytes) -> None:
        """Write bytes."""
        self._view()[offset : offset + len(data)] = data

    def digest(self) -> str:
        """A digest of all bytes: tells whether somebody else wrote (OPN-10)."""
        return hashlib.blake2b(self._view()).hexdigest()

    def exists(self) -> bool:
        """The name still leads to memory: nobody removed it (OPN-10)."""
        return (LINUX_FOLDER / self.name).exists() if sys.platform == "linux" else True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Unmap and remove."""
        if self._map is not None:
            self._map.close()
        if self._file is not None:
            os.close(self._file)
            self._remove()
        if self._shared is not None:
            self._shared.close()
            self._shared.unlink()

    def _remove(self) -> None:
        (LINUX_FOLDER / self.name).unlink(missing_ok=True)
        guard.forget(Kind.PATH, LINUX_FOLDER / self.name)

    def _view(self) -> memoryview | mmap.mmap:
        if self._map is not None:
            return self._map
        assert self._shared is not None
        assert self._shared.buf is not None
        return self._shared.buf
