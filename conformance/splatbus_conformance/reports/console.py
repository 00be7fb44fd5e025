"""The one way to the terminal, on which nothing that somebody else has said can do anything.

Testees, servers, recordings, stored reports and file names are quoted all over the harness. So the
console cleans what is about to be shown, and nobody has to remember where a text came from.
"""

import io
import re
import sys
import traceback
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from splatbus_schemas.visible import visible

PLAIN_WIDTH = 240
_LINE = re.compile(r"[^\n]*\n|[^\n]+")


class CleanConsole(Console):
    """A console whose text is text: markup is taken for none, and its own styles are what colours.

    Lines are cleaned as they will stand there, since wrapping can bring to the beginning of one
    what a CI system would obey.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """As of `Console`, which shows nothing but what comes through here."""
        said = ""
        for segment in super().render(renderable, options):
            if segment.control:  # of the harness: no text makes one
                yield segment
                continue
            for part in _LINE.findall(segment.text):
                shown = visible(said + part, kept="\n")
                clean = shown.removeprefix(said)
                if len(clean) == len(shown) and said:  # an order that began in the segment before
                    clean = "\\" + visible(part, kept="\n")
                said = "" if clean.endswith("\n") else said + clean
                yield Segment(clean, segment.style)


def console(plain: bool) -> CleanConsole:
    """Where people read."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # not every terminal knows → and ✓
    out = CleanConsole(no_color=plain or None, force_terminal=False if plain else None)
    if not (out.is_terminal or sys.stdout.isatty()):
        out.width = PLAIN_WIDTH
    return out


def complain(text: str) -> None:
    """Say something where errors go."""
    print(visible(text, kept="\n"), file=sys.stderr, flush=True)


def complain_of_fault() -> None:
    """Say which exception is being handled, and where it came from."""
    complain(traceback.format_exc().rstrip())
