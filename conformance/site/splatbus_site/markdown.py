"""Markdown as text: fences, headings and tables."""

import re
from collections.abc import Callable, Iterable, Sequence

_FENCE = re.compile(r"(^(?P<mark>```+).*?^(?P=mark)$)", re.MULTILINE | re.DOTALL)
_HEADING = re.compile(r"^(#+) (.+)$", re.MULTILINE)


def outside_of_fences(change: Callable[[str], str], text: str) -> str:
    """The text with `change` made to all of it but its fenced blocks."""
    pieces, start = [], 0
    for fence in _FENCE.finditer(text):
        pieces += [change(text[start : fence.start()]), fence[0]]
        start = fence.end()
    return "".join([*pieces, change(text[start:])])


def without_fences(text: str) -> str:
    """The text without its fenced blocks."""
    return _FENCE.sub("", text)


def headings(text: str) -> list[str]:
    """The text of each heading, in order."""
    return [title for _, title in _HEADING.findall(without_fences(text))]


def demoted(text: str) -> str:
    """The text with each heading one level down."""
    return outside_of_fences(lambda part: _HEADING.sub(r"#\1 \2", part), text)


def anchor(heading: str) -> str:
    """The fragment by which code hosts link to a heading."""
    plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
    return re.sub(r"[^\w\- ]", "", plain.strip().lower()).replace(" ", "-")


def anchors(text: str) -> list[str]:
    """The fragments of all headings: the second of two alike ends in `-1`."""
    found: list[str] = []
    counts: dict[str, int] = {}
    for each in map(anchor, headings(text)):
        count = counts.get(each, 0)
        counts[each] = count + 1
        found.append(f"{each}-{count}" if count else each)
    return found


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; cells are Markdown, on one line each."""
    lines = [list(head), ["---"] * len(head), *map(list, rows)]
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in lines)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
