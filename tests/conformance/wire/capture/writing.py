"""Captures made of recordings: what TCP would have sent, in any format and on any link."""

import struct
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from splatbus_conformance.wire.recording import Entry

FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16
PORTS = {"ipc": 6001, "msg": 6000}
BEGAN = 1_700_000_000
CLIENT_SEQ, SERVER_SEQ = 0xFFFFFFF0, 1000
"""The client's numbers begin again at 0 soon."""
NULL, ETHERNET, RAW, LOOP, COOKED, IPV4, IPV6, COOKED_2 = 0, 1, 101, 108, 113, 228, 229, 276
V4 = bytes([192, 168, 0, 1]), bytes([192, 168, 0, 2])
V6 = bytes(15) + b"\1", bytes(15) + b"\2"


class Sent(NamedTuple):
    """A segment: when, by whom (client or not), between which ports, and what."""

    t: float
    by_client: bool
    client_port: int
    server_port: int
    seq: int
    ack: int
    flags: int
    data: bytes = b""


def sent(entries: Iterable[Entry], ports: dict[str, int] = PORTS) -> list[Sent]:
    """The segments of a recording."""
    found: list[Sent] = []
    numbers: dict[tuple[str, int], list[int]] = {}
    for it in entries:
        of = it.channel, it.conn
        ends = 40_000 + it.conn + (1000 if it.channel == "msg" else 0), ports[it.channel]
        if of not in numbers:
            client, server = numbers[of] = [CLIENT_SEQ + 1, SERVER_SEQ + 1]
            found += [
                Sent(it.t, True, *ends, client - 1, 0, SYN),
                Sent(it.t, False, *ends, server - 1, client, SYN | ACK),
                Sent(it.t, True, *ends, client, server, ACK),
            ]
        if it.dir is None:
            continue
        by_client = it.dir == "c2s"
        mine, other = (0, 1) if by_client else (1, 0)
        now = numbers[of]
        flags = {"eof": FIN | ACK, "reset": RST | ACK, None: PSH | ACK}[
            None if it.event == "open" else it.event
        ]
        found.append(Sent(it.t, by_client, *ends, now[mine], now[other], flags, it.data or b""))
        now[mine] += len(it.data or b"") + bool(flags & FIN)
        if not flags & RST:
            found.append(Sent(it.t, not by_client, *ends, now[other], now[mine], ACK))
    return found


def framed(it: Sent, link: int = ETHERNET, *, v6: bool = False, vlan: bool = False) -> bytes:
    """A segment with its headers."""
    ends = (it.client_port, it.server_port)
    source, target = ends if it.by_client else ends[::-1]
    numbers = it.seq % 2**32, it.ack % 2**32 if it.flags & ACK else 0
    options = b"\1\1\1\1"
    tcp = struct.pack(">HHIIBBHHH", source, target, *numbers, 6 << 4, it.flags, 512, 0, 0)
    tcp += options + it.data
    addresses = b"".join((V6 if v6 else V4)[:: 1 if it.by_client else -1])
    if v6:
        hop_by_hop = bytes([6, 0, 1, 4, 0, 0, 0, 0])
        ip = struct.pack(">IHBB", 6 << 28, len(hop_by_hop) + len(tcp), 0, 64) + addresses
        ip += hop_by_hop + tcp
    else:
        ip = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 1, 0x4000, 64, 6, 0) + addresses + tcp
    kind = b"\x86\xdd" if v6 else b"\x08\x00"
    family = 10 if v6 else 2
    if link == ETHERNET:
        tag = b"\x81\x00\x00\x05" if vlan else b""
        frame = bytes(12) + tag + kind + ip
        return frame + bytes(60 - len(frame)) if len(frame) < 60 else frame
    return {
        NULL: struct.pack("<I", family),
        LOOP: struct.pack(">I", family),
        COOKED: bytes(14) + kind,
        COOKED_2: kind + bytes(18),
    }.get(link, b"") + ip


def pcap(
    segments: Iterable[Sent],
    link: int = ETHERNET,
    *,
    order: str = "<",
    nano: bool = False,
    snap: int = 1 << 18,
    v6: bool = False,
) -> bytes:
    """A pcap file."""
    magic = 0xA1B23C4D if nano else 0xA1B2C3D4
    parts = [struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, snap, link)]
    for it in segments:
        data = framed(it, link, v6=v6)
        ticks = round((BEGAN + it.t) * (1e9 if nano else 1e6))
        seconds, fraction = divmod(ticks, 10**9 if nano else 10**6)
        kept = data[:snap]
        parts += [struct.pack(f"{order}IIII", seconds, fraction, len(kept), len(data)), kept]
    return b"".join(parts)


def pcapng(
    segments: Sequence[Sent],
    links: Sequence[int] = (ETHERNET,),
    *,
    order: str = "<",
    v6: bool = False,
) -> bytes:
    """A pcapng file, whose interfaces take turns: the first counts microseconds, the second
    nanoseconds, the third in ticks of 2^-20 s from `BEGAN` on.
    """
    clocks = [(10**6, 0), (10**9, 0), (2**20, BEGAN)]
    options = [
        b"",
        struct.pack(f"{order}HHB3x", 9, 1, 9) + bytes(4),
        struct.pack(f"{order}HHB3x", 9, 1, 0x80 | 20)
        + struct.pack(f"{order}HHq", 14, 8, BEGAN)
        + bytes(4),
    ]
    parts = [block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1), order)]
    for link, more in zip(links, options, strict=False):
        parts.append(block(1, struct.pack(f"{order}HHI", link, 0, 0) + more, order))
    parts.append(block(5, bytes(12), order))  # statistics, which nobody needs
    for number, it in enumerate(segments):
        which = number % len(links)
        per_second, offset = clocks[which]
        ticks = round((BEGAN - offset + it.t) * per_second)
        data = framed(it, links[which], v6=v6)
        head = struct.pack(f"{order}IIIII", which, ticks >> 32, ticks % 2**32, len(data), len(data))
        parts.append(block(6, head + data + bytes(-len(data) % 4), order))
    return b"".join(parts)


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    """A block of a pcapng file."""
    length = struct.pack(f"{order}I", 12 + len(body))
    return struct.pack(f"{order}I", kind) + length + body + length
