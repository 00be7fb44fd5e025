"""The standard as one document for each reader: whoever writes a client, a server, or wants it all.

The chapters of 1.0 and 1.1 are the source, arranged by `outline`. An edition has each sentence that
binds its reader; of those that bind the other peer it quotes the ones that its text mentions.
"""

from __future__ import annotations

import itertools
import json
import posixpath
import re
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from typing import NamedTuple

from splatbus_schemas import outline
from splatbus_schemas.chapters import ANNEX_B, Block, Section, differences, mentioned, sections
from splatbus_schemas.data import VERSIONS, names, schema

PLACES = {
    "client": "editions/client.md",
    "server": "editions/server.md",
    "": "1.1/complete/README.md",
}
"""Where each edition stands in `spec/`, by its reader; the complete one, for all, on the site."""

PARTS = "editions/parts"
"""What is written for one edition alone, a file for each reader that has some."""
CHECKLIST, FILES = "Checklist", "Files beside this document"
SHORT = 16
"""Words of a sentence that a checklist repeats."""

_LEVEL = re.compile(r"\b(?:MUST NOT|MUST|SHOULD NOT|SHOULD|MAY)\b")
_BOUND = re.compile(r"(?:A|An) (?:client|server|peer|sender|receiver) (?=[A-Z]{3})")
_ASIDE = re.compile(r",? \((?:chapter|section) [^)]*\)")
_REFERENCE = re.compile(r"\b(?:chapter|section) (\d+(?:\.\d+)?)( there| of 1\.0)?")
_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?:|#)([^)\s#]+)(?:#[^)\s]*)?\)")
_OF_IDS = re.compile(r"\| (?:[A-Z]{3}-\d+(?:, )?)+ \|$")

Chapters = Sequence[Sequence[Section]]
Notes = Mapping[str, Sequence[Block]]


class Place(NamedTuple):
    """The number and title that a chapter or section has in an edition."""

    number: str
    title: str

    @property
    def heading(self) -> str:
        """Its heading, such as `5. Images` or `5.2 Colour`."""
        return f"{self.number}{'' if '.' in self.number else '.'} {self.title}"

    @property
    def anchor(self) -> str:
        """The fragment by which code hosts link to it."""
        return _anchor(self.heading)

    @property
    def link(self) -> str:
        """A reference to it."""
        kind = "section " if "." in self.number else "chapter " if self.number.isdigit() else ""
        return f"[{kind}{self.number}](#{self.anchor})"


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def documents(texts: Mapping[str, str]) -> dict[str, str]:
    """The editions by their places; `texts` are chapters and parts by their paths in `spec/`.

    ValueError for a reference to a section or a requirement that an edition has not, and for an
    annex B without its table of differences.
    """
    known = {path: sections(path, text) for path, text in sorted(texts.items())}
    notes = differences(texts[ANNEX_B])
    ids = {b.name for found in known.values() for each in found for b in each.blocks if b.name}
    if unknown := notes.keys() - ids - {each[:3] for each in ids}:
        raise ValueError(f"{ANNEX_B}: {sorted(unknown)} stand in no chapter")
    return {
        place: _edition(reader, known, _concerning(reader, notes))
        for reader, place in PLACES.items()
    }


def _concerning(reader: str, notes: Notes) -> Notes:
    others = outline.NOTES_FOR_OTHERS.get(reader)
    return {
        name: [note for note in found if not (others and others.match(note.text))]
        for name, found in notes.items()
    }


def _edition(reader: str, known: Mapping[str, Sequence[Section]], notes: Notes) -> str:
    arranged, hosts = _arranged(reader, known)
    blocks = [block for chapter in arranged for section in chapter for block in section.blocks]
    own = {block.name for block in blocks if block.name and reader in block.binds}
    quoted = _quoted(reader, arranged, own, notes)
    chapters = _chosen(reader, arranged, own, quoted)
    places = dict(_places(chapters))
    places |= {key: places[host] for key, host in hosts.items() if host in places}
    starts = {path: places[found[0].key] for path, found in known.items() if found[0].key in places}

    def linked(block: Block) -> str:
        return _linked(reader, block, places, starts).rstrip()

    def rendered(block: Block) -> str:
        text = linked(block._replace(text=_shown(reader, block, own)))
        if block.name in quoted:
            text = f"> **[{block.name}]** " + linked(block._replace(text=block.sentence))
        remarks = [linked(note) for note in notes.get(block.name or "", ())]
        gap = "\n" if text.rpartition("\n")[2].startswith(">") else "\n\n"
        return gap.join([text, "\n".join(remarks)]) if remarks else text

    body = []
    for chapter in chapters:
        for level, section in enumerate(chapter):
            body.append(f"{'###' if level else '##'} {places[section.key].heading}")
            body += [linked(note) for note in _of_subjects(chapter, notes) if not level]
            body += map(rendered, section.blocks)
    tail = _checklist(chapters, places, own) if reader else []
    tail += [f"## {FILES}", _files(reader, chapters, known)]
    contents = [
        f"{'  ' if level else ''}- [{places[section.key].heading}](#{places[section.key].anchor})"
        for chapter in chapters
        for level, section in enumerate(chapter)
        if not (level and reader)
    ]
    contents += [f"- [{line[3:]}](#{_anchor(line[3:])})" for line in tail if line[:3] == "## "]
    return "\n\n".join([outline.HEADS[reader], "\n".join(contents), *body, *tail]) + "\n"


def _of_subjects(chapter: Sequence[Section], notes: Notes) -> list[Block]:
    """Notes on all sentences of a subject, for the beginning of its chapter."""
    blocks = (block for section in chapter for block in section.blocks)
    subjects = sorted({block.name[:3] for block in blocks if block.name})
    return [note for subject in subjects for note in notes.get(subject, ())]


def _arranged(
    reader: str, known: Mapping[str, Sequence[Section]]
) -> tuple[list[list[Section]], dict[str, str]]:
    """The chapters that concern a reader, and of sections that are part of others, of which."""
    named = {path for paths in outline.CHAPTERS for path in paths}
    left_out = outline.LEFT_OUT[reader]
    foreign = {f"{PARTS}/{each}.md" for each in PLACES if each != reader}
    found = {
        section.key: section for path in known if path not in foreign for section in known[path]
    }
    for key, section in found.items():
        if any(key == each or (each[-1] == "." and key.startswith(each)) for each in left_out):
            rest = tuple(block for block in section.blocks if block.name)
            found[key] = section._replace(blocks=rest)
    hosts = {key: host for key, host in outline.CONTINUES.items() if {key, host} <= found.keys()}
    for key, host in hosts.items():
        both = (*found[host].blocks, *found[key].blocks)
        found |= {host: found[host]._replace(blocks=both), key: found[key]._replace(blocks=())}
    annex = []
    if reader == "client":
        annex = [Section("C", outline.CUDA_TITLE, ())]
        for key, section in found.items():
            moved = tuple(block for block in section.blocks if _is_for_a_gpu(key, block))
            if moved:
                rest = tuple(block for block in section.blocks if block not in moved)
                found[key] = section._replace(blocks=rest)
                annex.append(section._replace(key=f"C {key}", blocks=moved))
            if moved and not rest:
                hosts[key] = f"C {key}"
    order = [*outline.CHAPTERS, *((path,) for path in known if path not in named)]
    chapters = [
        [found[each.key] for path in paths if path not in foreign for each in known.get(path, ())]
        for paths in order
    ]
    return [chapter for chapter in [*chapters, annex] if chapter], hosts


def _is_for_a_gpu(key: str, block: Block) -> bool:
    is_table = block.text.startswith("|")
    return key in outline.CUDA_SECTIONS or (
        not is_table and outline.CUDA_BLOCK.search(block.text) is not None
    )


def _shown(reader: str, block: Block, own: Set[str]) -> str:
    """What a reader is shown of a block: all, the rows of a table that concern it, or nothing."""
    if not reader or block.name in own:
        return block.text
    if block.name or outline.OTHERS[reader].match(block.text):
        return ""
    if not block.text.startswith("|"):
        return block.text
    if not block.text.partition("\n")[0].endswith("| requirement |"):
        return block.text
    rows = [
        row
        for row in block.text.splitlines()
        if not (ids := _OF_IDS.search(row)) or own & set(mentioned(ids[0]))
    ]
    return "\n".join(rows) if len(rows) > 2 else ""


def _quoted(reader: str, chapters: Chapters, own: Set[str], notes: Notes) -> set[str]:
    """The sentences of the other peer that the text mentions, or a message's schema, and those that
    these mention.

    Whoever is sent to a section that has nothing else finds all of its sentences.
    """
    all_sections = [section for chapter in chapters for section in chapter]
    blocks = [block for section in all_sections for block in section.blocks]
    others = {block.name: block for block in blocks if block.name and block.name not in own}
    only_others = {
        section.key: {block.name for block in section.blocks if block.name}
        for section in all_sections
        if not any(_shown(reader, block, own) for block in section.blocks)
    }
    subjects = {block.name[:3] for block in blocks if block.name}
    read = [block._replace(text=_reworded(reader, _shown(reader, block, own))) for block in blocks]
    read += [note for name in own | subjects for note in notes.get(name or "", ())]
    quoted: set[str] = set()
    found = _of_forms() if reader == "server" else set()
    while read or found:
        found |= {name for block in read for name in mentioned(block.text)}
        for block in read:
            for match in _REFERENCE.finditer(block.text):
                found |= only_others.get(_key(block, match), set())
        fresh = (found & others.keys()) - quoted
        quoted |= fresh
        read = [others[name]._replace(text=others[name].sentence) for name in fresh]
        read += [note for name in fresh for note in notes.get(name or "", ())]
        found = set()
    return quoted


def _of_forms() -> set[str]:
    """The sentences about the forms of messages, which schemas name: a server complains by them of
    what it is sent. A client's part says by which it goes.
    """
    every = (json.dumps(schema(name, version)) for version in VERSIONS for name in names(version))
    return {found for text in every for found in mentioned(text)}


def _key(block: Block, reference: re.Match[str]) -> str:
    """The section that a reference in a block means."""
    number, elsewhere = reference.groups()
    return f"{'1.0' if elsewhere else posixpath.dirname(block.path)} {number}"


def _chosen(
    reader: str, chapters: Chapters, own: Set[str], quoted: Set[str]
) -> list[list[Section]]:
    """The chapters with what the reader is shown, without sections that have nothing left."""
    chosen = []
    for chapter in chapters:
        kept = [
            section._replace(
                blocks=tuple(
                    b for b in section.blocks if b.name in quoted or _shown(reader, b, own)
                )
            )
            for section in chapter
        ]
        chosen.append([kept[0], *(section for section in kept[1:] if section.blocks)])
    return [chapter for chapter in chosen if any(section.blocks for section in chapter)]


def _places(chapters: Chapters) -> Iterator[tuple[str, Place]]:
    """Each section by its key, with its number: chapters count, annexes have letters."""
    numbers, letters = itertools.count(1), iter("ABCDEFGH")
    for beginning, *others in chapters:
        annex = re.search(r"(?:^| )[A-Z]$", beginning.key)
        number = next(letters) if annex else str(next(numbers))
        yield beginning.key, Place(f"Annex {number}" if annex else number, beginning.title)
        for count, section in enumerate(others, 1):
            yield section.key, Place(f"{number}.{count}", section.title)


def _linked(
    reader: str, block: Block, places: Mapping[str, Place], starts: Mapping[str, Place]
) -> str:
    """The text with its links and references leading to where they belong in the edition."""
    here = posixpath.dirname(block.path)
    folder = posixpath.dirname(PLACES[reader])

    def reference(match: re.Match[str]) -> str:
        if match[0].startswith("section") and "." not in match[1]:
            return match[0]  # of an RFC
        key = _key(block, match)
        if key not in places:
            raise ValueError(f"{block.path}: there is no {match[0]} in this edition")
        return places[key].link

    def link(match: re.Match[str]) -> str:
        picture, text, target = match.groups()
        path = posixpath.normpath(posixpath.join(here, target))
        if picture:
            return f"![{text}]({posixpath.relpath(path, folder)})"
        return f"[{text}](#{starts[path].anchor})" if path in starts else text

    if block.text.startswith("```"):
        return block.text
    return _REFERENCE.sub(reference, _LINK.sub(link, _reworded(reader, block.text)))


def _reworded(reader: str, text: str) -> str:
    for phrase, other in (*outline.REWORDED, *(outline.REWORDED_FOR_ONE if reader else ())):
        text = phrase.sub(other, text)
    return text


def _files(reader: str, chapters: Chapters, known: Collection[str]) -> str:
    """A list of the files outside of the specification's text that the chapters name."""
    found = {
        posixpath.normpath(posixpath.join("spec", posixpath.dirname(block.path), target))
        for chapter in chapters
        for section in chapter
        for block in section.blocks
        for picture, _, target in _LINK.findall(_reworded(reader, block.text))
        if not picture
        and posixpath.normpath(posixpath.join(posixpath.dirname(block.path), target)) not in known
    }
    here = posixpath.dirname(f"spec/{PLACES[reader]}")
    return "\n".join(f"- [{path}]({posixpath.relpath(path, here)})" for path in sorted(found))


def _checklist(chapters: Chapters, places: Mapping[str, Place], own: Set[str]) -> list[str]:
    """Each sentence that binds the reader in one line, by chapter."""
    found = [f"## {CHECKLIST}"]
    for chapter in chapters:
        lines = [
            f"- [ ] {block.name} {_in_short(block.sentence)}"
            for section in chapter
            for block in section.blocks
            if block.name in own
        ]
        if lines:
            found += [f"**{places[chapter[0].key].heading}**", "\n".join(lines)]
    return found


def _in_short(sentence: str) -> str:
    """The first words of a sentence, from its key word on where all peers begin alike."""
    plain = _ASIDE.sub("", _BOUND.sub("", sentence))
    before = _LEVEL.split(plain, maxsplit=1)[0]
    words = _LEVEL.sub(lambda match: match[0].lower(), plain).split(" ")
    count = max(SHORT, before.count(" ") + SHORT // 2)
    return " ".join(words[:count]) + (" …" if len(words) > count else "")
