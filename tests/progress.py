"""How far a step is, and about how long is left."""

import os
import time
from collections.abc import Mapping, Sequence
from typing import ClassVar

LATER = "SPLATBUS_TESTS_LATER"
"""The variable that says how many seconds the steps that follow take."""
NAMED = 2


class Progress:
    """What has been done of a step, measured by how long each part took before."""

    PAUSE_SECONDS: ClassVar[float] = 10.0
    """Between two lines."""

    def __init__(self, step: str, seconds: Mapping[str, float]) -> None:
        self._step, self._seconds, self._left = step, seconds, dict(seconds)
        self._began = self._said = time.monotonic()

    def done(self, name: str) -> None:
        """A part of it has ended."""
        self._left.pop(name, None)

    def now(self, running: Sequence[str]) -> str:
        """A line, if it is time for one."""
        now = time.monotonic()
        if now - self._said < self.PAUSE_SECONDS:
            return ""
        self._said = now
        whole, left = sum(self._seconds.values()), sum(self._left.values())
        count = f"{len(self._seconds) - len(self._left)}/{len(self._seconds)}"
        line = f"{self._step} {count}, {minutes(now - self._began)} gone"
        if left < whole:
            here = (now - self._began) * left / (whole - left)
            line += f", about {minutes(here + float(os.environ.get(LATER, 0)))} left"
        names = ", ".join(running[:NAMED])
        return line + (f" ({names}{' …' if len(running) > NAMED else ''})" if names else "")


def minutes(seconds: float) -> str:
    """As a clock has it."""
    return f"{seconds // 60:.0f}:{seconds % 60:02.0f}"
