"""Show a piece of a recording to people: direction, hexadecimal and text, folded when long."""

from collections.abc import Iterable, Iterator

from splatbus_conformance.recording import Entry

ARROW = {"c2s": "testee → harness", "s2c": "harness → testee"}
SHOWN_BYTES = 48


def excerpt(entries: Iterable[Entry], lines: int) -> Iterator[str]:
    """The last `lines` entries, one line each; the stream of poses is only counted.

    A viewer sends poses all the time, and they would hide everything else.
    """
    entries = list(entries)
    telling = [entry for entry in entries if not _is_pose(entry)]
    shown = (telling or entries)[-lines:]
    for entry in shown:
        yield f"{entry.t:9.4f} s  {entry.channel:<3} #{entry.conn}  {_what(entry)}"
    if poses := len(entries) - len(telling):
        yield f"           and {poses} poses of the testee"


def _is_pose(entry: Entry) -> bool:
    data = entry.data or b""
    return (
        entry.dir == "c2s"
        and b"get_" not in data
        and (b"camera_pose" in data or b"point_cloud_pose" in data)
    )


def fold(data: bytes) -> str:
    """Bytes as characters and as hexadecimal text, the end left out when there are many."""
    head = data[:SHOWN_BYTES]
    more = f" … ({len(data)} bytes)" if len(data) > SHOWN_BYTES else ""
    text = "".join(chr(byte) if 32 <= byte < 127 else "·" for byte in data[: 3 * SHOWN_BYTES])
    return f"|{text}|  {head.hex(' ')}{more}"


def _what(entry: Entry) -> str:
    if entry.data is not None:
        return f"{ARROW[entry.dir or 'c2s']}  {fold(entry.data)}"
    if entry.event == "open":
        return "testee connects"
    who = "testee" if entry.dir == "c2s" else "harness"
    return f"{who} {'resets the connection' if entry.event == 'reset' else 'ends its stream'}"
