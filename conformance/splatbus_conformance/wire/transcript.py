"""Show a piece of a recording to people: who, what it reads as, and the bytes, folded when long.

What a failure is about is marked in the margin, and folded last of all.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import NamedTuple

from splatbus_conformance.wire.packets import HEADER, Packet, Splitter
from splatbus_conformance.wire.recording import Channel, Direction, Entry
from splatbus_conformance.wire.redaction import redacted

SENDER = {"c2s": "client", "s2c": "server"}
ARROW = {"c2s": "client → server", "s2c": "server → client"}
SHOWN_BYTES = 32
SHOWN_END = 4
SHOWN_CHARACTERS, SHOWN_TAIL = 160, 40
MARKED_CHARACTERS = 1200
"""Of a packet that a failure is about; such as these carry an init packet of 1.1 whole."""
MEMBER_BYTES = 16
MOST_LINES = 12
"""Of one piece; a flood holds thousands of packets."""
INDENT = " " * 13
MARK = ">"


class Mark(NamedTuple):
    """What a failure is about: a packet, or bytes that are none, by where they begin."""

    channel: Channel
    conn: int
    dir: Direction
    offset: int
    """In the stream of its sender."""
    pointer: str = ""
    """JSON Pointer to the member that matters, if it is one."""


@dataclass
class Piece:
    """An event, or what came of a stream up to the end of a packet."""

    entry: Entry
    """The first, if there were several."""
    data: bytes
    begins: int = 0
    """Where in its stream."""
    parts: int = 1
    """How many reads it took."""
    astray: bool = False
    """It follows a header that is none, so that nobody knows where its packets begin."""
    marks: tuple[Mark, ...] = ()
    packets: list[Packet] = field(default_factory=list)
    rest: bytes = b""
    """What is no whole packet, at its end."""
    refused: bool = False
    """That begins with a header that is none."""

    @property
    def looks(self) -> tuple[object, ...]:
        """Pieces that are the same in this look the same."""
        entry = self.entry
        return entry.channel, entry.conn, entry.dir, entry.event, self.data, self.marks


def excerpt(
    entries: Iterable[Entry], last: int, marks: Collection[Mark] = (), ours: Direction | None = None
) -> Iterator[str]:
    """The last so many pieces as lines of text, and those that are marked in any case.

    A viewer sends poses all the time, and they would hide everything else: of those of a testee
    only the last is shown, and what is marked; `ours` says in which direction the harness sends.
    """
    pieces = list(_pieces(entries, marks))
    poses = [piece for piece in pieces if piece.entry.dir != ours and _is_pose(piece)]
    hidden = [piece for piece in poses[:-1] if not piece.marks]
    if len(hidden) + 1 == len(pieces):
        hidden = []
    unseen = set(map(id, hidden))
    telling = [piece for piece in pieces if id(piece) not in unseen]
    runs = [list(run) for _, run in groupby(telling, lambda piece: piece.looks)]
    left_out = 0
    for place, run in enumerate(runs):
        if place < len(runs) - last and not run[0].marks:
            left_out += len(run)
            continue
        if left_out and any(it[0].marks for it in runs[:place]):
            yield f"{INDENT}… {left_out:,} more between"
        left_out = 0
        yield from _told(run[0])
        if len(run) > 1:
            yield f"{INDENT}{_more(len(run) - 1)}, until {run[-1].entry.t:.4f} s"
    if hidden:
        yield f"{INDENT}and poses of the client, {len(hidden):,} times"


def _pieces(entries: Iterable[Entry], marks: Collection[Mark]) -> list[Piece]:
    """Entries, those of one stream joined that hold parts of a packet."""
    pieces: list[Piece] = []
    streams: dict[tuple[object, ...], tuple[Splitter, Piece]] = {}
    sent: dict[tuple[object, ...], int] = {}
    for entry in redacted(entries):
        data = entry.data or b""
        key = entry.channel, entry.conn, entry.dir
        stream, before = streams.get(key, (Splitter(), None))
        begins = sent.get(key, 0)
        sent[key] = begins + len(data)
        if data and before and stream.rest and stream.refused is None:
            piece = before
            piece.data += data
            piece.parts += 1
        else:
            piece = Piece(entry, data, begins, astray=stream.refused is not None)
            pieces.append(piece)
        if data:
            piece.packets += stream.feed(data, entry.t)
            piece.rest, piece.refused = stream.rest, stream.refused is not None
            streams[key] = stream, piece
    for piece in pieces:
        piece.marks = tuple(mark for mark in marks if _holds(piece, mark))
    return pieces


def _holds(piece: Piece, mark: Mark) -> bool:
    entry = piece.entry
    same = (entry.channel, entry.conn, entry.dir) == (mark.channel, mark.conn, mark.dir)
    return same and piece.begins <= mark.offset < piece.begins + len(piece.data)


def _told(piece: Piece) -> Iterator[str]:
    entry = piece.entry
    margin = MARK if piece.marks else " "
    yield f"{margin}{entry.t:8.4f} s  {entry.channel:<3} #{entry.conn}  {_what(piece)}"
    if not piece.data:
        return
    for marked, line in _folded(_decoded(piece)):
        yield f"{MARK if marked else ' '}{INDENT[1:]}{line}"
    yield f"{margin}{INDENT[1:]}{hexadecimal(piece.data)}"


Line = tuple[bool, str]
"""Whether it is marked, and its text."""


def _folded(lines: Iterable[Line]) -> Iterator[Line]:
    """Lines, equal ones told once, and of many the first, the last, and those that are marked."""
    found: list[Line] = []
    for line, run in groupby(lines):
        count = len(list(run))
        found += [line] * count if count < 3 else [line, (False, _more(count - 1))]
    left_out = 0
    for place, line in enumerate(found):
        middle = MOST_LINES // 2 <= place < len(found) - MOST_LINES // 2
        if middle and not line[0]:
            left_out += 1
            continue
        if left_out:
            yield False, f"… {left_out:,} lines more"
            left_out = 0
        yield line


def _more(count: int) -> str:
    return f"… {count:,} more like it"


def fold(data: bytes) -> str:
    """Bytes as characters and as hexadecimal text, the middle left out when there are many."""
    return f"|{_characters(data)}|  {hexadecimal(data)}"


def hexadecimal(data: bytes) -> str:
    """Bytes as hexadecimal text, the middle left out when there are many."""
    if len(data) <= SHOWN_BYTES + SHOWN_END:
        return data.hex(" ")
    head, end = data[:SHOWN_BYTES].hex(" "), data[-SHOWN_END:].hex(" ")
    return f"{head} … {end} ({len(data)} bytes)"


def _decoded(piece: Piece) -> Iterator[Line]:
    """The packets that begin and end here, as text; what is no whole packet by its length."""
    data = piece.data
    if piece.astray:
        text = f"{len(data)} bytes after a header that is none: {_characters(data)}"
        yield bool(piece.marks), text
        return
    for packet in piece.packets:
        ends = packet.offset + HEADER + len(packet.payload)
        marks = [mark for mark in piece.marks if packet.offset <= mark.offset < ends]
        yield from _packet(packet, marks)
    rest = piece.rest
    last = piece.begins + len(data) - len(rest)
    marked = bool(piece.marks) and piece.marks[-1].offset >= last
    if piece.refused:
        text = f"a header that announces {int.from_bytes(rest[:HEADER], 'little'):,} bytes"
        yield marked, f"{text}: {_characters(rest)}" if len(rest) > HEADER else text
    elif rest:
        text = f"{len(rest)} bytes that are no whole packet: {_characters(rest)}"
        yield marked, text


def _packet(packet: Packet, marks: Sequence[Mark]) -> Iterator[Line]:
    payload = packet.payload
    places = {mark.pointer: _place(payload, mark.pointer) for mark in marks if mark.pointer}
    most = MARKED_CHARACTERS if marks else SHOWN_CHARACTERS
    text = _characters(payload, most, min(places.values(), default=0))
    yield bool(marks), f"{len(payload)} bytes: {text}"
    for pointer, at in places.items():
        yield True, f"{pointer}, from byte {at}: {fold(payload[at : at + MEMBER_BYTES])}"


def _place(payload: bytes, pointer: str) -> int:
    """Where the member that is pointed to begins, or the innermost around it that is there."""
    at = 0
    for part in pointer.split("/")[1:]:
        name = json.dumps(part.replace("~1", "/").replace("~0", "~")).encode()
        at = max(at, payload.find(name, at))
    return at


def _characters(data: bytes, most: int = SHOWN_CHARACTERS, at: int = 0) -> str:
    """Bytes as at most so many characters; the byte at this place stays."""
    if len(data) > most:
        head, tail, gap = most - SHOWN_TAIL, data[-SHOWN_TAIL:], "…".encode()
        if at < head - SHOWN_TAIL:
            data = data[:head] + gap + tail
        else:
            begin = at - SHOWN_TAIL
            middle = data[begin : begin + head - SHOWN_TAIL]
            data = data[:SHOWN_TAIL] + gap + middle + gap + tail
    text = data.decode("utf-8", "replace").replace("\N{REPLACEMENT CHARACTER}", "·")
    return "".join(character if character.isprintable() else "·" for character in text)


def _is_pose(piece: Piece) -> bool:
    data = piece.data
    return (
        piece.entry.dir == "c2s"
        and b"get_" not in data
        and (b"camera_pose" in data or b"point_cloud_pose" in data)
    )


def _what(piece: Piece) -> str:
    entry = piece.entry
    if entry.data is not None:
        parts = f", in {piece.parts} parts" if piece.parts > 1 else ""
        return f"{ARROW[entry.dir or 'c2s']}{parts}"
    if entry.event == "open":
        return "the client connects"
    who = f"the {SENDER[entry.dir or 'c2s']}"
    return f"{who} {'resets the connection' if entry.event == 'reset' else 'ends its stream'}"
