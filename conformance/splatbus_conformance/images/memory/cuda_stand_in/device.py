"""The harness's side of the stand-in: device memory and events that it shows to a testee.

They are the files that the library knows, read and written here without the library.
"""

import contextlib
import math
import os
import re
import secrets
import struct
import sys
from pathlib import Path
from typing import NamedTuple

from splatbus_conformance import guard

PARENT = Path("/dev/shm")
PREFIX = "splatbus-device-"
POISON = b"\xff"
"""What memory holds that nobody wrote, or that was freed; four of them are a NaN."""
HANDLE = re.compile(rb"splatbus-stand-in (memory|event) (\d{10}) ([0-9a-f]{16})\0*")
HANDLE_BYTES = 64
DEVICE_UUID = "GPU-00000000-0000-4000-8000-000000000000"
PROGRESS = struct.Struct("=QQ")
"""Of an event: count of its records, and the last of them that is complete."""


class Named(NamedTuple):
    """What a handle says."""

    kind: str
    """`memory` or `event`."""
    process: int
    """Who exported it."""
    name: str


def named_by(handle: bytes) -> Named | None:
    """What a handle says; None if it is none of the stand-in."""
    parts = HANDLE.fullmatch(handle) if len(handle) == HANDLE_BYTES else None
    return Named(parts[1].decode(), int(parts[2]), parts[3].decode()) if parts else None


def _write_at(file: int, data: bytes, offset: int) -> int:
    if sys.platform == "win32":
        raise OSError("the stand-in runtime is for POSIX")
    return os.pwrite(file, data, offset)


class Shared:
    """A file of the device, and the handle that another process opens it by."""

    def __init__(self, folder: Path, content: str, size: int) -> None:
        self.name = secrets.token_hex(8)
        """As the trace calls it."""
        self.size = size
        handle = f"splatbus-stand-in {content} {os.getpid():010} {self.name}".encode()
        self.handle = handle.ljust(HANDLE_BYTES, b"\0")
        self._path = folder / f"{content}-{self.name}"
        self._file = os.open(self._path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600)
        if sys.platform == "linux":
            os.posix_fallocate(self._file, 0, size)

    def free(self) -> None:
        """Remove it: nobody can open it any more. Once is enough, and more does no harm."""
        if self._file >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = -1


class StandInAllocation(Shared):
    """`size` bytes of device memory, poisoned; OSError if there is no room."""

    def __init__(self, folder: Path, size: int) -> None:
        super().__init__(folder, "memory", size)
        self.poison()

    def write(self, offset: int, data: bytes) -> None:
        """Write bytes; ValueError beyond its end."""
        if not 0 <= offset <= self.size - len(data):
            raise ValueError(f"{len(data)} bytes at {offset} of {self.size}")
        while data:
            written = _write_at(self._file, data, offset)
            data, offset = data[written:], offset + written

    def poison(self) -> None:
        """Spoil all of it."""
        self.write(0, POISON * self.size)

    def free(self) -> None:
        """Spoil and remove it; who has it mapped reads poison."""
        if self._file >= 0:
            self.poison()
        super().free()


class StandInEvent(Shared):
    """An interprocess event: recorded and complete in one, or with time between."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "event", PROGRESS.size)
        self._records = 0

    def begin(self) -> None:
        """Record it behind work that is not done yet: who waits now, waits for `complete`."""
        self._records += 1
        _write_at(self._file, PROGRESS.pack(self._records, self._records - 1), 0)

    def complete(self) -> None:
        """The work before the last record is done."""
        _write_at(self._file, PROGRESS.pack(self._records, self._records), 0)


class StandInDevice:
    """A folder of device memory; everything in it is gone when it is closed."""

    uuid, ordinal = DEVICE_UUID, 0

    def __init__(self) -> None:
        parent = PARENT if PARENT.is_dir() else None
        self.folder = guard.folder(f"{PREFIX}{os.getpid()}-", parent)
        self._shared: list[Shared] = []

    def fits(self) -> float:
        """It is memory of the host."""
        return math.inf

    def named(self, uuid: object) -> "StandInDevice":
        """This one: a server cannot ask the stand-in's library for a UUID."""
        return self

    def allocate(self, size: int) -> StandInAllocation:
        """Device memory; OSError if there is no room."""
        self._shared.append(allocation := StandInAllocation(self.folder, size))
        return allocation

    def event(self) -> StandInEvent:
        """An interprocess event that was never recorded: nobody waits for it."""
        self._shared.append(event := StandInEvent(self.folder))
        return event

    def read(self, handle: bytes, offset: int, size: int, after: bytes | None = None) -> bytes:
        """Bytes of the memory that this handle names, whoever exported it; ValueError if none.

        Work is done at once here, so there is no event to wait for.
        """
        named = named_by(handle)
        if named is None or named.kind != "memory":
            raise ValueError("no handle of memory of the stand-in CUDA runtime")
        try:
            with (self.folder / f"memory-{named.name}").open("rb") as file:
                file.seek(offset)
                data = file.read(size)
        except FileNotFoundError:
            raise ValueError("the memory that the handle names was freed") from None
        if len(data) < size:
            raise ValueError(f"the memory ends before byte {offset + size}")
        return data

    def forget(self, handle: bytes) -> None:
        """Nothing to let go of: each read opens what it reads."""

    def close(self) -> None:
        """Free everything."""
        for shared in self._shared:
            with contextlib.suppress(OSError):
                shared.free()
        guard.remove(self.folder)
