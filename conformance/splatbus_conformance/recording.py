"""Recordings: what crossed the wire, as lines of JSON (format: conformance/RECORDING.md)."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple

Channel = Literal["ipc", "msg"]
Direction = Literal["c2s", "s2c"]
Event = Literal["open", "eof", "reset"]


class Entry(NamedTuple):
    """One line: bytes in a direction, or an event."""

    t: float
    channel: Channel
    conn: int
    dir: Direction | None = None
    data: bytes | None = None
    event: Event | None = None


class RecordingError(ValueError):
    """A line breaks the format; the message names the file, the line and what is wrong."""


def to_line(entry: Entry) -> str:
    """One line of a recording, without its line break."""
    members: dict[str, Any] = {"t": round(entry.t, 6), "channel": entry.channel, "conn": entry.conn}
    if entry.event is not None:
        members["event"] = entry.event
    if entry.dir is not None:
        members["dir"] = entry.dir
    if entry.data is not None:
        members["hex"] = entry.data.hex()
    return json.dumps(members)


def from_line(line: str) -> Entry:
    """The entry in one line; ValueError says what is wrong with it."""
    members = json.loads(line)
    if not isinstance(members, dict):
        raise ValueError("the line is no JSON object")
    channel, event, direction = members.get("channel"), members.get("event"), members.get("dir")
    if channel not in ("ipc", "msg"):
        raise ValueError(f'channel is {channel!r}, not "ipc" or "msg"')
    if not isinstance(members.get("conn"), int) or not isinstance(members.get("t"), int | float):
        raise ValueError("t and conn must be numbers")
    if event not in (None, "open", "eof", "reset"):
        raise ValueError(f'event is {event!r}, not "open", "eof" or "reset"')
    if direction not in ("c2s", "s2c") and event != "open":
        raise ValueError(f'dir is {direction!r}, not "c2s" or "s2c"')
    if (event is None) == (members.get("hex") is None):
        raise ValueError("a line has either hex or event")
    data = bytes.fromhex(members["hex"]) if event is None else None
    return Entry(float(members["t"]), channel, members["conn"], direction, data, event)


def load(path: Path) -> list[Entry]:
    """Read a recording; RecordingError for a line that breaks the format, OSError for the file."""
    return list(_entries(path.read_text("utf-8").splitlines(), path.name))


def save(entries: Iterable[Entry], path: Path) -> None:
    """Write a recording."""
    path.write_text("".join(to_line(entry) + "\n" for entry in entries), "utf-8")


def _entries(lines: Iterable[str], name: str) -> Iterator[Entry]:
    for number, line in enumerate(lines, 1):
        if line.strip():
            try:
                yield from_line(line)
            except ValueError as error:
                raise RecordingError(f"{name}, line {number}: {error}") from None
