"""Captures made of recordings: what TCP would have sent, between two machines on an Ethernet."""

import struct
from collections.abc import Iterable

from splatbus_conformance.wire.capture.segments import ACK, FIN, RST, SYN, Segment
from splatbus_conformance.wire.recording import Entry

PORTS = {"ipc": 6001, "msg": 6000}
CLIENT, SERVER = "192.168.0.1", "192.168.0.2"
CLIENT_SEQ, SERVER_SEQ = 0xFFFFFFF0, 1000
"""The client's numbers begin again at 0 soon."""


def sent(entries: Iterable[Entry], ports: dict[str, int] = PORTS) -> list[Segment]:
    """The segments of a recording."""
    found: list[Segment] = []
    numbers: dict[tuple[str, int], list[int]] = {}

    def add(t: float, by_client: bool, of: tuple[str, int], flags: int, data: bytes = b"") -> None:
        channel, conn = of
        client = CLIENT, 40_000 + conn + (1000 if channel == "msg" else 0)
        ends = client, (SERVER, ports[channel])
        now = numbers.setdefault(of, [CLIENT_SEQ, SERVER_SEQ])
        mine, other = (0, 1) if by_client else (1, 0)
        found.append(
            Segment(
                round(t * 1e9),
                *(ends if by_client else ends[::-1]),
                now[mine] % 2**32,
                now[other] % 2**32 if flags & ACK else None,
                bool(flags & SYN),
                bool(flags & FIN),
                bool(flags & RST),
                data,
                len(data),
            )
        )
        now[mine] += len(data) + bool(flags & (SYN | FIN))

    for it in entries:
        of = it.channel, it.conn
        if of not in numbers:
            add(it.t, True, of, SYN)
            add(it.t, False, of, SYN | ACK)
            add(it.t, True, of, ACK)
        if it.dir is None:
            continue
        by_client = it.dir == "c2s"
        flags = {"eof": FIN | ACK, "reset": RST | ACK}.get(it.event or "", ACK)
        add(it.t, by_client, of, flags, it.data or b"")
        if it.event != "reset":
            add(it.t, not by_client, of, ACK)
    return found


def pcap(segments: Iterable[Segment], most: int = 1 << 18) -> bytes:
    """A pcap file that keeps so many bytes of a packet."""
    parts = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, most, 1)]
    for it in segments:
        data = framed(it)
        kept = data[:most]
        parts += [struct.pack("<IIII", *divmod(it.ns, 10**9), len(kept), len(data)), kept]
    return b"".join(parts)


def framed(it: Segment) -> bytes:
    """A segment with its headers."""
    flags = it.syn * SYN | it.fin * FIN | it.rst * RST | (it.ack is not None) * ACK
    ports, numbers = (it.source[1], it.target[1]), (it.seq % 2**32, (it.ack or 0) % 2**32)
    tcp = struct.pack(">HHIIBBHHH", *ports, *numbers, 5 << 4, flags, 512, 0, 0) + it.data
    ends = b"".join(bytes(map(int, end[0].split("."))) for end in (it.source, it.target))
    ip = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 1, 0x4000, 64, 6, 0) + ends + tcp
    return bytes(12) + b"\x08\x00" + ip
