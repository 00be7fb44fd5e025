"""Show a piece of a recording to people: who, what it reads as, and the bytes, folded when long."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from splatbus_conformance.packets import HEADER, Splitter
from splatbus_conformance.recording import Entry

SENDER = {"c2s": "client", "s2c": "server"}
ARROW = {"c2s": "client → server", "s2c": "server → client"}
SHOWN_BYTES = 32
SHOWN_END = 4
SHOWN_CHARACTERS = 160
INDENT = " " * 13


@dataclass
class Piece:
    """An event, or what came of a stream up to the end of a packet."""

    entry: Entry
    """The first, if there were several."""
    data: bytes
    parts: int = 1
    """How many reads it took."""
    astray: bool = False
    """It follows a header that is none, so that nobody knows where its packets begin."""


def excerpt(entries: Iterable[Entry], last: int, *, to_the_end: bool = False) -> Iterator[str]:
    """The last so many pieces as lines of text; the stream of poses is only counted.

    A viewer sends poses all the time, and they would hide everything else. With `to_the_end` the
    very last is shown though it is a pose.
    """
    pieces = _pieces(entries)
    kept = pieces[-1] if pieces and to_the_end else None
    telling = [piece for piece in pieces if piece is kept or not _is_pose(piece)]
    for piece in (telling or pieces)[-last:]:
        entry = piece.entry
        yield f"{entry.t:9.4f} s  {entry.channel:<3} #{entry.conn}  {_what(piece)}"
        if piece.data:
            lines = *_decoded(piece), hexadecimal(piece.data)
            yield from (f"{INDENT}{line}" for line in lines)
    if poses := len(pieces) - len(telling):
        yield f"{INDENT}and poses of the client, {poses} times"


def _pieces(entries: Iterable[Entry]) -> list[Piece]:
    """Entries, those of one stream joined that hold parts of a packet."""
    pieces: list[Piece] = []
    streams: dict[tuple[object, ...], tuple[Splitter, Piece]] = {}
    for entry in entries:
        data = entry.data or b""
        key = entry.channel, entry.conn, entry.dir
        stream, before = streams.get(key, (Splitter(), None))
        if data and before and stream.rest and stream.refused is None:
            before.data += data
            before.parts += 1
            stream.feed(data, entry.t)
            continue
        piece = Piece(entry, data, astray=stream.refused is not None)
        pieces.append(piece)
        if data:
            stream.feed(data, entry.t)
            streams[key] = stream, piece
    return pieces


def fold(data: bytes) -> str:
    """Bytes as characters and as hexadecimal text, the middle left out when there are many."""
    return f"|{_characters(data)}|  {hexadecimal(data)}"


def hexadecimal(data: bytes) -> str:
    """Bytes as hexadecimal text, the middle left out when there are many."""
    if len(data) <= SHOWN_BYTES + SHOWN_END:
        return data.hex(" ")
    head, end = data[:SHOWN_BYTES].hex(" "), data[-SHOWN_END:].hex(" ")
    return f"{head} … {end} ({len(data)} bytes)"


def _decoded(piece: Piece) -> Iterator[str]:
    """The packets that begin and end here, as text; what is no whole packet by its length."""
    data = piece.data
    if piece.astray:
        yield f"{len(data)} bytes after a header that is none: {_characters(data)}"
        return
    stream = Splitter()
    for packet in stream.feed(data, 0.0):
        yield f"{len(packet.payload)} bytes: {_characters(packet.payload)}"
    if stream.refused is not None:
        header = data[stream.refused : stream.refused + HEADER]
        yield f"a header that announces {int.from_bytes(header, 'little'):,} bytes"
    elif stream.rest:
        yield f"{len(stream.rest)} bytes that are no whole packet: {_characters(stream.rest)}"


def _characters(data: bytes) -> str:
    if len(data) > SHOWN_CHARACTERS:
        data = data[: SHOWN_CHARACTERS - 40] + "…".encode() + data[-40:]
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
