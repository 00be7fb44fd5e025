"""The time that a packet may take [FRM-5], whoever reads it."""

from __future__ import annotations

import math

import pytest
from splatbus_wire.errors import FramingError
from splatbus_wire.framing import encode_packet
from splatbus_wire.packet_reader import COMPLETION_SECONDS, PacketReader

PACKET = encode_packet(b"{}")


def read(reader: PacketReader, data: bytes, now: float) -> list[bytes]:
    reader.receive(data, now)
    return list(reader.packets(now))


def test_time_begins_with_the_first_byte_and_goes_on_whatever_follows() -> None:
    reader = PacketReader()
    assert reader.deadline == math.inf
    assert read(reader, PACKET[:1], 5.0) == []
    assert reader.deadline == 5.0 + COMPLETION_SECONDS
    assert read(reader, PACKET[1:5], 9.0) == []
    assert reader.deadline == 5.0 + COMPLETION_SECONDS
    assert reader.incomplete


def test_time_ends_with_the_last_byte() -> None:
    reader = PacketReader()
    read(reader, PACKET[:3], 5.0)
    assert read(reader, PACKET[3:], 6.0) == [b"{}"]
    assert reader.deadline == math.inf


def test_what_begins_behind_a_whole_packet_has_its_own_time() -> None:
    reader = PacketReader()
    read(reader, PACKET[:3], 5.0)
    assert read(reader, PACKET[3:] + PACKET[:1], 8.0) == [b"{}"]
    assert reader.deadline == 8.0 + COMPLETION_SECONDS


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


def test_what_stands_before_a_bad_header_is_handed_out() -> None:
    reader = PacketReader()
    reader.receive(PACKET + bytes(4), 0.0)
    assert reader.next_packet(0.0) == b"{}"
    with pytest.raises(FramingError, match="FRM-3"):
        reader.next_packet(0.0)
