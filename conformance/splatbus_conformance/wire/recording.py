"""Recordings: what crossed the wire, as lines of JSON (format: conformance/RECORDING.md)."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeGuard

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.given_files import decoded, from_json, shown

Channel = Literal["ipc", "msg"]
WORDS: dict[Channel, str] = {"ipc": "IPC", "msg": "message"}
"""For people."""
Direction = Literal["c2s", "s2c"]
Event = Literal["open", "eof", "reset"]
MOST_LINE = 1 << 24
"""Bytes of a line. Eight packets of the greatest length fit, and no read returns as much."""
_HEX = re.compile("([0-9a-fA-F]{2})*")


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
    members = from_json(line)
    if not isinstance(members, dict):
        raise ValueError("the line is no JSON object")
    if nulls := [name for name, value in members.items() if value is None]:
        raise ValueError(f"{shown(nulls[0])} is null")
    names = ("t", "channel", "conn", "dir", "hex", "event")
    t, channel, conn, direction, text, event = (members.get(name) for name in names)
    if not _is_number(t):
        raise ValueError(f"t is {shown(t)}, no number")
    if channel not in ("ipc", "msg"):
        raise ValueError(f'channel is {shown(channel)}, not "ipc" or "msg"')
    if not _is_number(conn) or conn != int(conn):
        raise ValueError(f"conn is {shown(conn)}, no integer")
    if event not in (None, "open", "eof", "reset"):
        raise ValueError(f'event is {shown(event)}, not "open", "eof" or "reset"')
    if direction not in ("c2s", "s2c") and not (direction is None and event == "open"):
        raise ValueError(f'dir is {shown(direction)}, not "c2s" or "s2c"')
    if (event is None) == (text is None):
        raise ValueError("a line has either hex or event")
    if text is not None and not (isinstance(text, str) and _HEX.fullmatch(text)):
        raise ValueError("hex is no text of two hexadecimal digits a byte")
    data = None if text is None else bytes.fromhex(text)
    return Entry(float(t), channel, int(conn), direction, data, event)


def _is_number(value: object) -> TypeGuard[int | float]:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and abs(value) <= LIMITS["max_safe_integer"]
    )


def read(path: Path) -> Iterator[Entry]:
    """Read a recording line by line, no more of it in memory than a line.

    Raises RecordingError for a line that breaks the format, OSError for the file.
    """
    with path.open("rb") as file:
        begins, number = 0, 0
        while line := file.readline(MOST_LINE + 1):
            number += 1
            if len(line) > MOST_LINE:
                text = f"the line has more than {MOST_LINE:,} bytes, which no read has"
                raise RecordingError(f"{path.name}, line {number}: {text}")
            try:
                text = decoded(line, begins)
            except ValueError as error:
                raise RecordingError(f"{path.name}: {error}") from None
            begins += len(line)
            if text.strip():
                try:
                    entry = from_line(text)
                except ValueError as error:
                    raise RecordingError(f"{path.name}, line {number}: {error}") from None
                yield entry


def load(path: Path) -> list[Entry]:
    """All of a recording, as `read`."""
    return list(read(path))
