"""What a testee sent, as text that people can read and that can do nothing on a page."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from markupsafe import Markup
from splatbus_schemas.visible import visible

from splatbus_conformance.wire.transcript import INDENT, MARK

HEX = re.compile("([0-9a-f]{2} )*[0-9a-f]{2}( …|$)")
ID = re.compile("([A-Z]{3}-[0-9]+)")
BASE64 = re.compile("[A-Za-z0-9+/=]+")
CODE = re.compile("`([^`]*)`")
ALL_OF_IT = "the JSON report has all of it, and so have recordings (--record)"


class TranscriptLine(NamedTuple):
    """A line of a transcript."""

    text: str
    kind: str
    """`event`, `more` of the event before, its bytes as `hex`, or a `note` of the page's own; with
    `guilty` behind it, what a failure is about.
    """


def shown(value: Any, most: int) -> Any:
    """Text of `most` characters, each of them to be seen; what is none, or is markup, as it is."""
    if type(value) is not str:
        return value
    text = cut(value, most)
    return text if text.isprintable() else visible(text, kept="\n\t")


def base64(value: str) -> Markup:
    """What may stand in an address of data as it is, however long; nothing else of a text."""
    return Markup("".join(BASE64.findall(value)))


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


def parts(sentence: str, marked: re.Pattern[str]) -> list[tuple[str, bool]]:
    """A sentence in pieces, and of each whether it is what the group of a pattern finds."""
    found = enumerate(marked.split(sentence))
    return [(text, place % 2 == 1) for place, text in found if text]


def _line(text: str) -> TranscriptLine:
    guilty = " guilty" if text.startswith(MARK) else ""
    if not text[1:].startswith(INDENT[1:]):
        return TranscriptLine(text, f"event{guilty}")
    told = text[len(INDENT) :]
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
