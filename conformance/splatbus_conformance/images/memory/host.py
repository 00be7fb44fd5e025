"""Shared memory that the harness announces to a testee: the judge's own, small reading of MEM-4."""

import contextlib
import hashlib
import mmap
import os
import secrets
import sys
import time
from multiprocessing import resource_tracker, shared_memory
from pathlib import Path
from typing import Self

LINUX_FOLDER = Path("/dev/shm")
YOUNG_SECONDS = 60
PREFIX = "splatbus-check-"


def sweep() -> None:
    """Remove what runs of the harness that were killed have left behind.

    Each run holds a lock on its memory, and the system drops the lock when it dies. What was made
    a moment ago is left alone: its maker may not have come to lock it yet.
    """
    if sys.platform != "linux":
        return
    import fcntl

    for path in LINUX_FOLDER.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime < YOUNG_SECONDS:
                continue
            file = os.open(path, os.O_RDWR | os.O_NOFOLLOW)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
            finally:
                os.close(file)


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
    little memory.
    """

    def __init__(self, size: int, name: str | None = None) -> None:
        self.name = name or f"{PREFIX}{secrets.token_hex(6)}"
        self.size = size
        self._file: int | None = None
        self._shared: shared_memory.SharedMemory | None = None
        if sys.platform == "linux":
            import fcntl

            flags = os.O_CREAT | os.O_EXCL | os.O_RDWR
            self._file = os.open(LINUX_FOLDER / self.name, flags, 0o600)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            try:
                _reserve(self._file, size)
            except OSError:
                os.close(self._file)
                (LINUX_FOLDER / self.name).unlink(missing_ok=True)
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
            (LINUX_FOLDER / self.name).unlink(missing_ok=True)
        if self._shared is not None:
            self._shared.close()
            self._shared.unlink()

    def _view(self) -> memoryview | mmap.mmap:
        if self._map is not None:
            return self._map
        assert self._shared is not None
        assert self._shared.buf is not None
        return self._shared.buf
