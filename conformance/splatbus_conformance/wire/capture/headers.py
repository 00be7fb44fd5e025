"""The headers before what a program sent: of the link, of IP, of TCP."""

from typing import NamedTuple

from splatbus_conformance.wire.capture.files import Frame

ETHERNET, RAW, LOOPBACK, COOKED, COOKED_2 = 1, (12, 14, 101, 228, 229), (0, 108), 113, 276
LINKS = (ETHERNET, *RAW, *LOOPBACK, COOKED, COOKED_2)
"""The kinds of first headers that are read (tcpdump.org/linktypes.html)."""
IPV4, IPV6 = b"\x08\x00", b"\x86\xdd"
VLAN = (b"\x81\x00", b"\x88\xa8", b"\x91\x00")
TCP, FRAGMENT, AUTHENTICATION = 6, 44, 51
OPTIONS = (0, 43, 60)
"""Headers of IPv6 that come before TCP, and say their length in eights of bytes."""
FIN, SYN, RST, ACK = 1, 2, 4, 16

Endpoint = tuple[bytes, int]
"""Address and port."""


class Segment(NamedTuple):
    """What TCP sent at once."""

    ns: int
    source: Endpoint
    target: Endpoint
    seq: int
    ack: int | None
    syn: bool
    fin: bool
    rst: bool
    data: bytes
    """As much of its payload as was captured."""
    length: int
    """Bytes of the whole payload."""


def segment(frame: Frame) -> Segment | None:
    """The segment in a frame, if there is one that can be read."""
    try:
        return _segment(frame)
    except IndexError:
        return None


def _segment(frame: Frame) -> Segment | None:
    data = frame.data
    at = _behind_link(frame.link, data)
    if at is None:
        return None
    version = data[at] >> 4
    if version == 4:
        size, end = 4, at + _number(data, at + 2, 2)
        is_fragment = bool(_number(data, at + 6, 2) & 0x3FFF)
        protocol, first, behind = data[at + 9], at + 12, at + 4 * (data[at] & 15)
        is_endless = end == at
    elif version == 6:
        size, end, first = 16, at + 40 + _number(data, at + 4, 2), at + 8
        is_endless = end == at + 40
        protocol, behind, is_fragment = _behind_options(data, data[at + 6], at + 40)
    else:
        return None
    if protocol != TCP or is_fragment:
        return None
    if is_endless:  # the sender's network card was to divide it
        end = len(data)
    flags = data[behind + 13]
    begin = behind + 4 * (data[behind + 12] >> 4)
    addresses = data[first : first + size], data[first + size : first + 2 * size]
    ports = _number(data, behind, 2), _number(data, behind + 2, 2)
    source, target = zip(addresses, ports, strict=True)
    return Segment(
        frame.ns,
        source,
        target,
        _number(data, behind + 4, 4),
        _number(data, behind + 8, 4) if flags & ACK else None,
        bool(flags & SYN),
        bool(flags & FIN),
        bool(flags & RST),
        data[begin:end],
        max(0, end - begin),
    )


def _behind_link(link: int, data: bytes) -> int | None:
    """Where the header of IP begins, if it is one of IP."""
    if link in RAW:
        return 0
    if link in LOOPBACK:
        return 4
    if link == ETHERNET:
        at = 12
        while data[at : at + 2] in VLAN:
            at += 4
        kind, behind = data[at : at + 2], at + 2
    elif link == COOKED:
        kind, behind = data[14:16], 16
    elif link == COOKED_2:
        kind, behind = data[:2], 20
    else:
        return None
    return behind if kind in (IPV4, IPV6) else None


def _behind_options(data: bytes, kind: int, at: int) -> tuple[int, int, bool]:
    """The protocol behind the options of IPv6, where it begins, and if it is in fragments."""
    is_fragment = False
    while kind in (*OPTIONS, FRAGMENT, AUTHENTICATION):
        if kind == FRAGMENT:
            is_fragment, length = bool(_number(data, at + 2, 2) & 0xFFF9), 8
        elif kind == AUTHENTICATION:
            length = 4 * (data[at + 1] + 2)
        else:
            length = 8 * (data[at + 1] + 1)
        kind, at = data[at], at + length
    return kind, at, is_fragment


def _number(data: bytes, at: int, size: int) -> int:
    if len(data) < at + size:
        raise IndexError(at)
    return int.from_bytes(data[at : at + size], "big")
