import pytest
from splatbus_schemas import LIMITS
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.framing import PacketDecoder, encode_packet

MAX = LIMITS["max_payload_bytes"]


@pytest.mark.parametrize("size", [0, MAX + 1])
def test_a_payload_outside_the_limits_is_never_sent(size):
    with pytest.raises(ProtocolError) as caught:
        encode_packet(bytes(size))
    assert caught.value.requirement == "FRM-2"
    assert str(size) in str(caught.value)


@pytest.mark.parametrize(
    ("header", "code", "seems"),
    [
        (b"\x00\x00\x00\x00", "malformed_packet", None),
        (b"\x01\x00\x10\x00", "packet_too_large", None),
        (b"\xff\xff\xff\xff", "packet_too_large", None),
        (b"GET / HTTP/1.1\r\n", "packet_too_large", "HTTP"),
        (b"\x16\x03\x01\x02\x00\x01", "packet_too_large", "TLS"),
    ],
)
@pytest.mark.parametrize("step", [1, 100])
def test_a_bad_header_ends_the_stream_after_the_packets_before_it(header, code, seems, step):
    decoder = PacketDecoder()
    stream = encode_packet(b"one") + encode_packet(b"two") + header + b"junk"
    for start in range(0, len(stream), step):
        decoder.receive(stream[start : start + step])
    assert decoder.next_packet() == b"one"
    assert decoder.next_packet() == b"two"
    for _ in range(2):
        with pytest.raises(FramingError) as caught:
            decoder.next_packet()
        assert (caught.value.code, caught.value.requirement) == (code, "FRM-3")
        assert caught.value.offset == 14
        assert ("can be trusted; " in str(caught.value)) == (seems is not None)
        assert (seems or "") in str(caught.value)
        decoder.receive(bytes(MAX))
    assert held_bytes(decoder) == 0
    assert not decoder.incomplete


def test_a_promise_reserves_nothing():
    decoder = PacketDecoder()
    decoder.receive(encode_packet(bytes(MAX))[:100])
    assert held_bytes(decoder) == 100


class CountingBuffer(bytearray):
    """Counts the bytes that its own operations copy."""

    copied = 0

    def __iadd__(self, data):
        self.copied += len(data)
        return super().__iadd__(data)

    def __getitem__(self, key):
        found = super().__getitem__(key)
        self.copied += len(found) if isinstance(key, slice) else 1
        return found

    def __delitem__(self, key):
        size = len(self)
        super().__delitem__(key)
        self.copied += len(self) if len(self) != size else 0


def held_bytes(decoder: PacketDecoder) -> int:
    return len(decoder.unfinished)


def bytes_copied(stream: bytes, step: int) -> int:
    decoder = PacketDecoder()
    decoder.unfinished = buffer = CountingBuffer()
    packets = 0
    for start in range(0, len(stream), step):
        decoder.receive(stream[start : start + step])
        packets += len(list(iter(decoder.next_packet, None)))
    assert packets
    return buffer.copied


@pytest.mark.parametrize("payload_bytes", [1, 139, MAX])
@pytest.mark.parametrize("step", [1, 7, 65_536, MAX + 4])
def test_work_is_linear_in_the_bytes_received(payload_bytes, step):
    packet = encode_packet(bytes(payload_bytes))
    stream = packet * max(1, 65_536 // len(packet))
    segments_received = -(-len(stream) // step)
    header_reads = 4 * (segments_received + len(stream) // len(packet))
    assert bytes_copied(stream, step) <= 3 * len(stream) + header_reads
