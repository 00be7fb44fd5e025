import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.framing import PacketDecoder, encode_packet

MAX = LIMITS["max_payload_bytes"]
payloads = st.lists(st.binary(min_size=1, max_size=40), max_size=8)
cuts = st.lists(st.integers(0, 10_000))


def drain(decoder: PacketDecoder) -> list[bytes]:
    return list(iter(decoder.next_packet, None))


def segments(stream: bytes, cuts: list[int]) -> list[bytes]:
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    return [stream[a:b] for a, b in itertools.pairwise(edges)]


def test_a_packet_is_its_length_little_endian_and_its_payload():
    assert encode_packet(b'{"a":1}') == b'\x07\x00\x00\x00{"a":1}'
    assert encode_packet(bytes(MAX))[:4] == b"\x00\x00\x10\x00"


@pytest.mark.parametrize("size", [0, MAX + 1])
def test_a_payload_outside_the_limits_is_never_sent(size):
    with pytest.raises(ProtocolError) as caught:
        encode_packet(bytes(size))
    assert caught.value.requirement == "FRM-2"
    assert str(size) in str(caught.value)


@given(payloads, st.binary(min_size=1, max_size=20), st.integers(0, 23), cuts, st.booleans())
def test_any_segmentation_gives_the_same_packets(sent, last, kept, cuts, at_once):
    whole = b"".join(map(encode_packet, sent))
    unfinished = encode_packet(last)[: min(kept, len(last) + 3)]
    decoder = PacketDecoder()
    received = []
    for segment in segments(whole + unfinished, cuts):
        decoder.receive(segment)
        if at_once:
            received += drain(decoder)
    received += drain(decoder)
    assert received == sent
    assert decoder.incomplete == bool(unfinished)
    decoder.receive(encode_packet(last)[len(unfinished) :])
    assert not decoder.incomplete
    assert drain(decoder) == [last]


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


def test_the_largest_payload_is_taken():
    decoder = PacketDecoder()
    decoder.receive(encode_packet(bytes(MAX)))
    assert decoder.next_packet() == bytes(MAX)


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
        packets += len(drain(decoder))
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
