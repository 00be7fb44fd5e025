"""Show a piece of a recording to people: who, what it reads as, and the bytes, folded when long."""

from collections.abc import Iterable, Iterator

from splatbus_conformance.packets import HEADER, Splitter
from splatbus_conformance.recording import Entry

SENDER = {"c2s": "client", "s2c": "server"}
ARROW = {"c2s": "client → server", "s2c": "server → client"}
SHOWN_BYTES = 32
SHOWN_END = 4
SHOWN_CHARACTERS = 160
INDENT = " " * 13


def excerpt(entries: Iterable[Entry], last: int) -> Iterator[str]:
    """The last so many entries as lines of text; the stream of poses is only counted.

    A viewer sends poses all the time, and they would hide everything else.
    """
    entries = list(entries)
    telling = [entry for entry in entries if not _is_pose(entry)]
    for entry in (telling or entries)[-last:]:
        yield f"{entry.t:9.4f} s  {entry.channel:<3} #{entry.conn}  {_what(entry)}"
        if entry.data is not None:
            yield from (
                f"{INDENT}{line}" for line in (*_decoded(entry.data), hexadecimal(entry.data))
            )
    if poses := len(entries) - len(telling):
        yield f"{INDENT}and poses of the client, {poses} times"


def fold(data: bytes) -> str:
    """Bytes as characters and as hexadecimal text, the middle left out when there are many."""
    return f"|{_characters(data)}|  {hexadecimal(data)}"


def hexadecimal(data: bytes) -> str:
    """Bytes as hexadecimal text, the middle left out when there are many."""
    if len(data) <= SHOWN_BYTES + SHOWN_END:
        return data.hex(" ")
    head, end = data[:SHOWN_BYTES].hex(" "), data[-SHOWN_END:].hex(" ")
    return f"{head} … {end} ({len(data)} bytes)"


def _decoded(data: bytes) -> Iterator[str]:
    """The packets that begin and end here, as text; what is no whole packet by its length."""
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


def _is_pose(entry: Entry) -> bool:
    data = entry.data or b""
    return (
        entry.dir == "c2s"
        and b"get_" not in data
        and (b"camera_pose" in data or b"point_cloud_pose" in data)
    )


def _what(entry: Entry) -> str:
    if entry.data is not None:
        return ARROW[entry.dir or "c2s"]
    if entry.event == "open":
        return "the client connects"
    who = f"the {SENDER[entry.dir or 'c2s']}"
    return f"{who} {'resets the connection' if entry.event == 'reset' else 'ends its stream'}"
