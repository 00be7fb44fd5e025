"""The time that a packet may take [FRM-5], whoever reads it."""

from __future__ import annotations

import math

from splatbus_wire.framing import encode_packet
from splatbus_wire.packet_reader import COMPLETION_SECONDS, PacketReader

PACKET = encode_packet(b"{}")


def test_time_that_is_not_the_peers_does_not_count() -> None:
    reader = PacketReader()
    reader.receive(PACKET + PACKET[:2], 5.0)
    assert list(reader.packets(5.0)) == [b"{}"]
    reader.hold()
    assert reader.deadline == math.inf
    reader.receive(PACKET[2:] + PACKET[:1], 60.0)
    assert reader.deadline == math.inf
    reader.go_on(70.0)
    assert list(reader.packets(70.0)) == [b"{}"]
    assert reader.deadline == 70.0 + COMPLETION_SECONDS
