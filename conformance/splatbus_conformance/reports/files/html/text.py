"""What a testee sent, as text that people can read and that can do nothing on a page."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from markupsafe import Markup
from splatbus_schemas.visible import visible

INDENT = " " * 12
"""Of the lines of a transcript that belong to the line before, behind the margin (`excerpt`)."""
MARK = ">"
"""In the margin of what a failure is about."""
HEX = re.compile("([0-9a-f]{2} )*[0-9a-f]{2}( …|$)")
ID = re.compile("([A-Z]{3}-[0-9]+)")
ALL_OF_IT = "all of it is in the JSON report, and of a run with --record in its recordings"


class TranscriptLine(NamedTuple):
    """A line of a transcript."""

    text: str
    kind: str
    """`event`, `more` of the event before, its bytes as `hex`, or a `note` of the page's own; with
    `guilty` behind it, what a failure is about.
    """


class SentencePart(NamedTuple):
    """A piece of a sentence."""

    text: str
    marked: bool
    """It is code, or an id."""


def seen(value: Any) -> Any:
    """Text with every character to be seen; what is no text, or is markup, stays as it is."""
    if not isinstance(value, str) or isinstance(value, Markup) or value.isprintable():
        return value
    return visible(value, kept="\n\t")


def cut(text: str, most: int) -> str:
    """Text of so many characters at most, and a note in its middle of how many were left out."""
    if len(text) <= most:
        return text
    head, tail = text[: most * 2 // 3], text[len(text) - most // 3 :]
    return f"{head} … [{len(text) - len(head) - len(tail):,} characters left out] … {tail}"


def transcript(evidence: Sequence[str], most: int) -> tuple[TranscriptLine, ...]:
    """Lines of evidence, `most` characters in all; a note says what was left out in the middle."""
    lines = [_line(cut(text, most // 4)) for text in _ends(evidence, most)]
    head = _within(lines, most * 2 // 3)
    tail = _within(lines[len(head) :][::-1], most // 3)
    if len(lines) == len(evidence) and len(head) + len(tail) == len(lines):
        return tuple(lines)
    left_out = len(evidence) - len(head) - len(tail)
    note = f"… {left_out:,} lines left out here; {ALL_OF_IT} …"
    return (*head, TranscriptLine(note, "note"), *tail[::-1])


def spans(sentence: str) -> tuple[SentencePart, ...]:
    """A sentence of the specification, its code apart."""
    parts = sentence.split("`")
    return tuple(SentencePart(text, number % 2 == 1) for number, text in enumerate(parts) if text)


def ids(sentence: str) -> tuple[SentencePart, ...]:
    """A sentence of a report, the ids of requirements apart."""
    parts = ID.split(sentence)
    return tuple(SentencePart(text, number % 2 == 1) for number, text in enumerate(parts) if text)


def words(check: str) -> str:
    """The name of a check as words."""
    return check.removeprefix("check_").replace("_", " ")


def _line(text: str) -> TranscriptLine:
    guilty = " guilty" if text.startswith(MARK) else ""
    if not text[1:].startswith(INDENT):
        return TranscriptLine(text, f"event{guilty}")
    told = text[1:].removeprefix(INDENT)
    return TranscriptLine(told, f"{'hex' if HEX.match(told) else 'more'}{guilty}")


def _ends(evidence: Sequence[str], most: int) -> Sequence[str]:
    """The lines of which some may be shown; a report may have any number."""
    lines = most // 8 + 1
    return evidence if len(evidence) <= 2 * lines else [*evidence[:lines], *evidence[-lines:]]


def _within(lines: Sequence[TranscriptLine], most: int) -> list[TranscriptLine]:
    found, left = [], most
    for line in lines:
        left -= len(line.text) + 1
        if left < 0:
            break
        found.append(line)
    return found
