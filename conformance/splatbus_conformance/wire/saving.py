"""Write recordings, for their owner alone and without tokens."""

import os
import stat
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from splatbus_conformance.wire.recording import Entry, to_line
from splatbus_conformance.wire.redaction import Redactor

OWNER_ALONE = 0o600
"""A session holds handles of memory, and what was shown."""


class Recorder:
    """Writes a recording as it grows, a line at once. Raises OSError."""

    def __init__(self, path: Path) -> None:
        self._file = _written(path)
        self._redactor = Redactor()

    def note(self, entry: Entry) -> None:
        """Take what has passed. Raises OSError."""
        self._file.write(to_line(self._redactor.redact(entry)) + "\n")

    def close(self) -> None:
        """Nothing more will pass. Raises OSError."""
        self._file.close()


def save(entries: Iterable[Entry], path: Path) -> None:
    """Write a recording. Raises OSError."""
    recorder = Recorder(path)
    try:
        for entry in entries:
            recorder.note(entry)
    finally:
        recorder.close()


def _written(path: Path) -> TextIO:
    """The file, empty; on POSIX its mode is 0600, also where it was there before."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT, OWNER_ALONE)
    try:
        if stat.S_ISREG(os.fstat(file).st_mode):  # and no pipe or device
            if sys.platform != "win32":
                os.fchmod(file, OWNER_ALONE)
            os.ftruncate(file, 0)
        return os.fdopen(file, "w", buffering=1, encoding="utf-8", newline="\n")
    except BaseException:
        os.close(file)
        raise
