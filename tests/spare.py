"""What a machine can bear beside what it does."""

import time
from pathlib import Path

STAT = Path("/proc/stat")
IDLE, WAITS_FOR_DISK = 4, 5
"""Fields of its first line."""
SPARE = 0.05
"""The share of all processors from which on they had time."""
LOOK_SECONDS = 1.0


class Spare:
    """How many more than usual to run at a time, of what waits more than it computes.

    One more for each second in which processors had time, one fewer for each in which they had not;
    none where the system does not tell.
    """

    def __init__(self, most: int) -> None:
        """At most so many."""
        self._most, self._more = most, 0
        self._then, self._before = time.monotonic(), _ticks()

    def now(self) -> int:
        """How many, to be asked again and again."""
        if time.monotonic() >= self._then + LOOK_SECONDS:
            before, self._then, self._before = self._before, time.monotonic(), _ticks()
            idle, all_ = (now - then for now, then in zip(self._before, before, strict=True))
            step = 1 if idle > SPARE * all_ else -1
            self._more = min(max(0, self._more + step), self._most)
        return self._more


def _ticks() -> tuple[int, int]:
    """Of all processors together: what they had nothing to do, and all."""
    try:
        words = STAT.read_text("ascii").partition("\n")[0].split()
    except OSError:
        return 0, 0
    return int(words[IDLE]) + int(words[WAITS_FOR_DISK]), sum(map(int, words[1:9]))
