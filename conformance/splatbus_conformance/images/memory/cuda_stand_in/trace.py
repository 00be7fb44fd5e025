"""What programs did with the stand-in: one call a line, as the library wrote it down."""

import json
from pathlib import Path
from typing import NamedTuple


class Call(NamedTuple):
    """A call of the runtime; what its function has nothing to do with is left at its default."""

    time: float
    """When it returned, in seconds of the monotonic clock."""
    process: int
    function: str
    """`cudaMemcpy2DAsync`, say; `cudaLoad` and `cudaExit` are begin and end of the process."""
    code: int
    device: int
    """The current one."""
    memory: str = ""
    """Name of the device memory that was allocated, opened, closed or read."""
    size: int = 0
    opened: int = 0
    """How often the process has it open, after the call."""
    offset: int = 0
    """Where a copy began to read, in bytes from the beginning of the memory."""
    pitch: int = 0
    to: str = ""
    """Name of the device memory that was written; none for memory of the host."""
    to_offset: int = 0
    width: int = 0
    """Bytes of a row that were copied or set."""
    height: int = 0
    stream: int = 0
    """0 is the default stream, 2 a thread's own."""
    digest: int = 1
    """Adler-32 of what was copied out of the memory of another process, row by row."""
    event: str = ""
    flags: int = 0
    which: int = 0
    """The device that was asked for."""

    def __str__(self) -> str:
        usual = {"code": 0, **self._field_defaults}
        shown = {
            name: value
            for name, value in self._asdict().items()
            if name not in NOT_TOLD and value != usual.get(name)
        }
        return f"{self.function}({', '.join(f'{name} {value}' for name, value in shown.items())})"

    def __repr__(self) -> str:
        return str(self)

    @property
    def ok(self) -> bool:
        """It succeeded."""
        return self.code == 0


class Trace:
    """The calls in a file that programs still append to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._calls: list[Call] = []
        self._read = 0

    def calls(self) -> list[Call]:
        """All that were made until now, in the order of their ends."""
        if self.path.exists():
            with self.path.open("rb") as file:
                file.seek(self._read)
                whole, line_end, _ = file.read().rpartition(b"\n")
            self._read += len(whole) + len(line_end)
            self._calls += map(parse, whole.splitlines())
        return self._calls


def parse(line: bytes) -> Call:
    """The call that a line tells of. ValueError if it is none."""
    told = json.loads(line)
    common = {name: told.pop(key) for key, name in COMMON.items()}
    return Call(**common, **{name: value for name, value in told.items() if name in Call._fields})


NOT_TOLD = ("time", "process", "function", "digest")
"""What a reader of a verdict does not want to know of a call."""
COMMON = {"t": "time", "pid": "process", "call": "function", "code": "code", "on": "device"}
