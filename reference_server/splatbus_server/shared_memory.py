"""Host memory that other processes open by name, and that a killed server does not leave behind.

On Linux a segment is a file in /dev/shm. Its owner holds an exclusive lock on it for as long as it
lives; the kernel drops the lock however the owner ends, so a segment that can be locked is nobody's
[OPN-9]. A process id in the name would tell less: ids are used again.

Elsewhere it is the standard library's shared memory. On Windows that is a named mapping, which goes
with its last handle; on macOS, where segments cannot be listed, the library's resource tracker is
a process of its own that outlives a killed owner and removes what it had.
"""

from __future__ import annotations

import errno
import mmap
import os
import re
import secrets
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np

PREFIX = "splatbus-ref-"  # of this implementation: others need not lock what they own
NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,29}")
DIRECTORY = Path("/dev/shm")
MEMORY = Path("/proc/meminfo")


class Segment:
    """Shared memory that this process owns.

    Attributes:
        name: what a client opens, as the init packet's ``memory.name`` says it.
        buffer: its bytes, zero at first, writable, every page already in memory.
        taken: what another program has taken of it, which on Linux alone is seen; nothing of what
            is whole. Who writes where it was cut short is killed by a signal, so this is asked
            before; and whoever is told its name once that is gone finds nothing.
    """

    def __init__(
        self,
        name: str,
        buffer: memoryview,
        cleanup: ExitStack,
        taken: Callable[[], str] = str,
    ) -> None:
        self.name = name
        self.buffer = buffer
        self.taken = taken
        self._cleanup = cleanup

    def close(self) -> None:
        """Removes the name at once, and the memory with the last view of it; once is enough."""
        self._cleanup.close()


def create(size: int, prefix: str = PREFIX) -> Segment:
    """Creates shared memory that only this user can open, under a name that was free [MEM-4].

    On Linux nobody can open it for writing, or cut it short by its name, who does not change its
    mode first; this process has it from when it made it.

    A forked child that does not exec keeps the segment's lock for as long as it lives.

    Args:
        size: in bytes; fixed for life, since a reader of truncated memory is killed [MEM-5].
        prefix: how the name begins; random characters follow.

    Raises:
        ValueError: the size is not positive, or no name of 30 characters can begin so [MEM-2].
        OSError: there is no room; the message says for how many bytes.
    """
    if size <= 0:
        raise ValueError(f"shared memory of {size} bytes")
    while True:
        name = prefix + secrets.token_hex(6)
        if not NAME.fullmatch(name):
            raise ValueError(f"no shared memory can be named {name!r} [MEM-2]")
        segment = _create_named(name, size)
        if segment is not None:
            return segment


def sweep_stale(prefix: str = PREFIX) -> list[str]:
    """Removes this user's segments that begin so and whose owner is gone [OPN-9].

    Returns:
        their names; always none on systems other than Linux, which tidy up by themselves.
    """
    return [path.name for path in _listed(prefix) if _remove_if_unowned(path)]


def create_with_standard_library(name: str, size: int) -> Segment | None:
    """Creates the segment where there is no /dev/shm; None if the name is taken."""
    system_name = f"Local\\{name}" if sys.platform == "win32" else name
    try:
        memory = SharedMemory(system_name, create=True, size=size)
    except FileExistsError:
        return None
    except OSError as error:
        raise OSError(
            error.errno or errno.ENOMEM, f"no {size} bytes of shared memory: {error}"
        ) from None
    assert memory.buf is not None
    with ExitStack() as cleanup:
        cleanup.callback(memory.unlink)
        buffer = memory.buf[:size]  # the system may have rounded up
        cleanup.callback(_unmap, buffer, memory.close)
        _touch(buffer)
        return Segment(name, buffer, cleanup.pop_all())


def _touch(buffer: memoryview) -> None:
    """Writes to every page: the first touch of a frame's pages would cost tens of milliseconds.

    NumPy lets other threads run meanwhile; a memoryview does not.
    """
    np.frombuffer(buffer, np.uint8)[:: mmap.PAGESIZE] = 0


def _unmap(buffer: memoryview, close: Callable[[], None]) -> None:
    try:
        buffer.release()
        close()
    except BufferError:  # arrays still view it: it is unmapped with the last of them
        pass


if sys.platform == "linux":
    import fcntl

    def free_bytes() -> int:
        """How much more shared memory there is: of its file system, and of the machine."""
        system = os.statvfs(DIRECTORY)
        available = os.sysconf("SC_AVPHYS_PAGES") * mmap.PAGESIZE
        with suppress(OSError):  # which tells what caches would let go of, too
            (line,) = re.findall(r"^MemAvailable: +([0-9]+) kB$", MEMORY.read_text(), re.M)
            available = int(line) * 1024
        return min(system.f_bavail * system.f_frsize, available)

    def _create_named(name: str, size: int) -> Segment | None:
        """None if the name was taken, or a sweep got hold of the file before it was locked."""
        path = DIRECTORY / name
        free = free_bytes()
        if size > free:  # told before a page is taken: reserving would first take what there is
            raise OSError(errno.ENOSPC, f"no {size} bytes in {DIRECTORY}: {free} are free")
        with ExitStack() as cleanup:
            try:
                file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o400)
            except FileExistsError:
                return None
            cleanup.callback(os.close, file)
            cleanup.callback(path.unlink, missing_ok=True)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return None
            if os.fstat(file).st_nlink == 0:
                return None
            try:  # unlike truncation this reserves the pages: too little room is an error here, now
                os.posix_fallocate(file, 0, size)
            except OSError as error:
                raise OSError(
                    error.errno, f"no {size} bytes in {DIRECTORY}: {error.strerror}"
                ) from None
            mapping = mmap.mmap(file, size)
            buffer = memoryview(mapping)
            cleanup.callback(_unmap, buffer, mapping.close)
            _touch(buffer)

            def taken() -> str:
                found = os.fstat(file)
                if found.st_nlink == 0:
                    return f"the name {path}"
                return "" if found.st_size >= size else f"the end of {path}"

            return Segment(name, buffer, cleanup.pop_all(), taken)

    def _listed(prefix: str) -> list[Path]:
        return [path for path in DIRECTORY.iterdir() if path.name.startswith(prefix)]

    def _remove_if_unowned(path: Path) -> bool:
        with ExitStack() as cleanup:
            try:  # O_NONBLOCK: somebody's named pipe must not hold us up
                file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
                cleanup.callback(os.close, file)
                if os.fstat(file).st_uid != os.geteuid():
                    return False
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
            except OSError:  # owned and alive, another user's, or gone meanwhile
                return False
        return True

else:
    _create_named = create_with_standard_library

    def free_bytes() -> int:
        """How much more there is cannot be asked here: as much as anybody may want."""
        return sys.maxsize

    def _listed(prefix: str) -> list[Path]:
        return []

    def _remove_if_unowned(path: Path) -> bool:
        return False
