"""What a terminal shows: bars, and lines that are written over."""

import math
import shutil
from collections.abc import Sequence
from typing import TextIO

_EIGHTHS = " ▁▂▃▄▅▆▇█"
_LEFT_EIGHTHS = " ▏▎▍▌▋▊▉█"


def columns(numbers: Sequence[float], least: float, most: float) -> str:
    """Return one bar for each number, standing: full at `most`, and empty only at `least`."""
    if math.isinf(most - least):  # of the largest numbers
        return columns([n / 4 for n in numbers], least / 4, most / 4)
    span = most - least if most > least else 1.0
    eighths = (max(round((n - least) / span * 8), 1 if n > least else 0) for n in numbers)
    return "".join(_EIGHTHS[eighth] for eighth in eighths)


def bar(share: float, width: int) -> str:
    """Return a lying bar that takes this share, 0 to 1, of so many letters."""
    whole, eighths = divmod(round(8 * width * share), 8)
    return "█" * whole + (_LEFT_EIGHTHS[eighths] if eighths else "")


class Lines:
    """Writes lines over those that it wrote before, on a terminal; else below them."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._terminal = out.isatty()
        self._above = 0

    def write(self, lines: Sequence[str]) -> None:
        """Show these lines; on a terminal as much of them as it has room for."""
        if self._terminal:
            size = shutil.get_terminal_size()
            lines = [line[: size.columns - 1] for line in lines[: size.lines - 1]]
            back = f"\x1b[{self._above}F" if self._above else ""
            self._out.write(f"{back}\x1b[J")
            self._above = len(lines)
        self._out.write("".join(f"{line}\n" for line in lines))
        self._out.flush()
