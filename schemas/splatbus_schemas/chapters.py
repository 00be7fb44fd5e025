"""Chapters of the prose as values: sections, and the blocks of text in them."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator
from typing import NamedTuple

from splatbus_schemas import outline

_BLOCK = re.compile(
    r"^```[\s\S]*?^```$|^\*\*\[[A-Z]{3}-\d+\]\*\* .+\n\n(?:>.*\n?)+|^#+ .+$|^.+(?:\n.+)*", re.M
)
_HEADING = re.compile(r"(#+) (?:Annex )?(?:(\d+(?:\.\d+)?|[A-Z](?=\.)(?:\.\d+)?)\.? )?(.+)$")
_REQUIREMENT = re.compile(r"\*\*\[([A-Z]{3}-\d+)\]\*\* (.+)\n\n> Binds: (.+?)\.")
_MENTION = re.compile(r"\b([A-Z]{3})-(\d+)(?: to \1-(\d+))?")
_DIFFERENCES = re.compile(r"^\| 1\.0 \| on a connection .*\n\|---\|---\|\n((?:\|.*\n)+)", re.M)
ANNEX_B = "1.1/annex-b-compatibility.md"


class Block(NamedTuple):
    """A paragraph, table, fence or requirement, and the path of its file in `spec/`."""

    text: str
    path: str

    @property
    def name(self) -> str | None:
        """The id of a requirement."""
        match = _REQUIREMENT.match(self.text)
        return match and match[1]

    @property
    def sentence(self) -> str:
        """The sentence of a requirement."""
        match = _REQUIREMENT.match(self.text)
        return match[2] if match else ""

    @property
    def binds(self) -> str:
        """The peers that a requirement binds."""
        match = _REQUIREMENT.match(self.text)
        return match[3] if match else ""


class Section(NamedTuple):
    """A section, or the beginning of a file, by version and number there, such as `1.0 5.4`."""

    key: str
    title: str
    blocks: tuple[Block, ...]


def sections(path: str, text: str) -> list[Section]:
    """The sections of one file, the first one being what stands before its first section."""
    version = posixpath.dirname(path)
    found: list[tuple[str, str, list[Block]]] = []
    for match in _BLOCK.finditer(text):
        if outline.NOT_HERE.match(match[0]):
            continue
        heading = _HEADING.match(match[0])
        if heading and len(heading[1]) <= 2:
            marks, number, title = heading.groups()
            if marks == "#":
                number, title = number or "1", outline.TITLES.get(path, title)
            found.append((f"{version} {number or title}", title, []))
        else:
            found[-1][2].append(Block(match[0].rstrip("\n"), path))
    return [Section(key, title, tuple(blocks)) for key, title, blocks in found]


def mentioned(text: str) -> Iterator[str]:
    """The ids in a text, `INI-1 to INI-3` being three."""
    for subject, first, last in _MENTION.findall(text):
        for number in range(int(first), int(last or first) + 1):
            yield f"{subject}-{number}"


def differences(annex: str) -> dict[str, tuple[Block, ...]]:
    """How the table of annex B.3 says that sentences of 1.0 read, by their id or subject."""
    notes: dict[str, tuple[Block, ...]] = {}
    (rows,) = _DIFFERENCES.findall(annex)
    for row in rows.splitlines():
        former, now = row.strip("| ").split(" | ")
        names, topic = former.split(": ", 1)
        for name in names.split(", "):
            note = Block(f"> In 1.1 ({topic}): {now}.", ANNEX_B)
            notes[name] = (*notes.get(name, ()), note)
    return notes
