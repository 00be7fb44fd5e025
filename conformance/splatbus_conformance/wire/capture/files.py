"""Capture files, pcap and pcapng: the frames that they hold, read one by one."""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

SECOND = 1_000_000_000
"""In nanoseconds, in which all times of captures are."""
MOST_FRAME = 1 << 24
SECTION, INTERFACE, OLD_PACKET, SIMPLE_PACKET, PACKET = 0x0A0D0D0A, 1, 2, 3, 6
RESOLUTION, OFFSET = 9, 14
"""Options of an interface: ticks of its clock in a second, and seconds to add."""
PCAP = {
    bytes.fromhex("d4c3b2a1"): ("<", 1000),
    bytes.fromhex("a1b2c3d4"): (">", 1000),
    bytes.fromhex("4d3cb2a1"): ("<", 1),
    bytes.fromhex("a1b23c4d"): (">", 1),
}
"""Byte order and nanoseconds in a unit of time, by the first bytes of a file."""
PCAPNG = SECTION.to_bytes(4, "big")


class Frame(NamedTuple):
    """What was captured at once."""

    ns: int
    link: int
    """The kind of its first header: a LINKTYPE of tcpdump.org."""
    data: bytes


class CaptureError(ValueError):
    """A capture cannot be read; the message names the file, the byte and what is wrong."""


class _Interface(NamedTuple):
    link: int
    most: int
    """Bytes kept of a frame, 0 for all."""
    per_second: int
    offset: int


def is_capture(path: Path) -> bool:
    """Whether the first bytes of a file are those of a capture. Raises OSError.

    Of what can be read but once, a pipe, nothing is read: it is none.
    """
    if not path.is_file():
        return False
    with path.open("rb") as file:
        first = file.read(4)
    return first in PCAP or first == PCAPNG


def frames(path: Path) -> Iterator[Frame]:
    """The frames of a capture in their order. Raises CaptureError, OSError."""
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        first = file.read(4)
        if first in PCAP:
            yield from _pcap(file, size, str(path), *PCAP[first])
        else:
            yield from _pcapng(file, size, str(path))


def _pcap(file: BinaryIO, size: int, name: str, order: str, unit: int) -> Iterator[Frame]:
    if size < 24:
        raise CaptureError(f"{name}: the header of a pcap file has 24 bytes, this one {size}")
    file.seek(20)
    link = struct.unpack(f"{order}I", file.read(4))[0] & 0xFFFF
    at = 24
    while at < size:
        if size - at < 16:
            raise _cut_short(name, at, 16, size)
        seconds, fraction, kept, _ = struct.unpack(f"{order}IIII", file.read(16))
        if kept > MOST_FRAME:
            raise CaptureError(f"{name}, byte {at}: a frame of {kept:,} bytes, which none has")
        if size - at < 16 + kept:
            raise _cut_short(name, at, 16 + kept, size)
        yield Frame(seconds * SECOND + fraction * unit, link, file.read(kept))
        at += 16 + kept


def _pcapng(file: BinaryIO, size: int, name: str) -> Iterator[Frame]:
    order, at, ns = "<", 0, 0
    interfaces: list[_Interface] = []
    while at < size:
        file.seek(at)
        head = file.read(12)
        if len(head) < 12:
            raise _cut_short(name, at, 12, size)
        if head[:4] == PCAPNG:
            order = "<" if head[8:] == bytes.fromhex("4d3c2b1a") else ">"
            interfaces = []
        kind, length = struct.unpack(f"{order}II", head[:8])
        if length < 12 or length % 4:
            raise CaptureError(f"{name}, byte {at}: a block of {length:,} bytes, which none has")
        if size - at < length:
            raise _cut_short(name, at, length, size)
        if kind in (INTERFACE, OLD_PACKET, SIMPLE_PACKET, PACKET):
            if length > MOST_FRAME:
                raise CaptureError(f"{name}, byte {at}: a frame of {length:,} bytes, no real one")
            body = (head[8:] + file.read(length - 12))[: length - 12]
            try:
                if kind == INTERFACE:
                    interfaces.append(_interface(body, order))
                else:
                    frame = _frame(kind, body, order, interfaces, ns)
                    ns = frame.ns
                    yield frame
            except (struct.error, IndexError):
                raise CaptureError(f"{name}, byte {at}: a block that is not as it says") from None
        at += length


def _interface(body: bytes, order: str) -> _Interface:
    link, _, most = struct.unpack_from(f"{order}HHI", body)
    per_second, offset, at = 1_000_000, 0, 8
    while at + 4 <= len(body):
        option, length = struct.unpack_from(f"{order}HH", body, at)
        if option == RESOLUTION:
            power = body[at + 4]
            per_second = 2 ** (power & 0x7F) if power & 0x80 else 10**power
        elif option == OFFSET:
            (offset,) = struct.unpack_from(f"{order}q", body, at + 4)
        at += 4 + length + -length % 4
    return _Interface(link, most, per_second, offset)


def _frame(kind: int, body: bytes, order: str, interfaces: list[_Interface], ns: int) -> Frame:
    if kind == SIMPLE_PACKET:  # which has no time of its own
        (length,) = struct.unpack_from(f"{order}I", body)
        link, most, *_ = interfaces[0]
        return Frame(ns, link, body[4 : 4 + (min(length, most) if most else length)])
    fields = "IIIII" if kind == PACKET else "HHIIII"
    which, *_, high, low, kept, _ = struct.unpack_from(f"{order}{fields}", body)
    interface = interfaces[which]
    if kept > len(body) - 20:
        raise IndexError(kept)
    ticks = (high << 32 | low) * SECOND // interface.per_second
    return Frame(ticks + interface.offset * SECOND, interface.link, body[20 : 20 + kept])


def _cut_short(name: str, at: int, wanted: int, size: int) -> CaptureError:
    return CaptureError(
        f"{name}, byte {at}: the file ends {size - at:,} bytes into a record of {wanted:,}; "
        f"`head -c {at} {name}` has what is whole"
    )
