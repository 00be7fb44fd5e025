"""The time that a packet may take [FRM-5], whoever reads it."""

from __future__ import annotations

import math

from splatbus_wire.framing import encode_packet
from splatbus_wire.packet_reader import COMPLETION_SECONDS, PacketReader

PACKET = encode_packet(b"{}")


def read(reader: PacketReader, data: bytes, now: float) -> list[bytes]:
    reader.receive(data, now)
    return list(reader.packets(now))


def test_each_packet_has_its_own_time_from_its_first_byte_to_its_last() -> None:
    reader = PacketReader()
    assert reader.deadline == math.inf
    for piece, now in ((PACKET[:1], 5.0), (PACKET[1:5], 9.0)):
        assert read(reader, piece, now) == []
        assert reader.deadline == 5.0 + COMPLETION_SECONDS
    assert read(reader, PACKET[5:] + PACKET[:1], 9.5) == [b"{}"]
    assert reader.deadline == 9.5 + COMPLETION_SECONDS
    assert read(reader, PACKET[1:], 10.0) == [b"{}"]
    assert reader.deadline == math.inf


def test_time_that_is_not_the_peers_does_not_count() -> None:
    reader = PacketReader()
    read(reader, PACKET + PACKET[:2], 5.0)
    reader.hold()
    assert reader.deadline == math.inf
    reader.receive(PACKET[2:] + PACKET[:1], 60.0)
    assert reader.deadline == math.inf
    reader.go_on(70.0)
    assert list(reader.packets(70.0)) == [b"{}"]
    assert reader.deadline == 70.0 + COMPLETION_SECONDS
