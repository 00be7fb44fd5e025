"""The judge's own reading of packets."""

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.wire.packets import Splitter, packet
from splatbus_schemas import LIMITS

PAYLOADS = st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=5)


def test_a_packet_is_a_length_and_a_payload() -> None:
    assert packet(b'{"type":"get_viewport_size"}')[:5] == b"\x1c\x00\x00\x00{"


@settings(deadline=None, max_examples=100)
@given(PAYLOADS, st.lists(st.integers(0, 230), max_size=8))
def test_packets_are_the_same_however_the_stream_is_cut(
    payloads: list[bytes], cuts: list[int]
) -> None:
    stream = b"".join(map(packet, payloads))
    places = sorted({0, len(stream), *(cut for cut in cuts if cut < len(stream))})
    splitter = Splitter()
    found = []
    for now, (begin, end) in enumerate(pairwise(places)):
        found += splitter.feed(stream[begin:end], float(now))
    assert [each.payload for each in found] == payloads
    assert splitter.rest == b""
    assert splitter.offset == len(stream)
    for each in found:
        header = stream[each.offset : each.offset + 4]
        assert int.from_bytes(header, "little") == len(each.payload)


def test_a_packet_knows_when_its_first_and_last_byte_arrived() -> None:
    splitter = Splitter()
    stream = packet(b"abc") + packet(b"de")
    assert splitter.feed(stream[:2], 1.0) == []
    assert splitter.feed(stream[2:5], 2.0) == []
    (first,) = splitter.feed(stream[5:9], 3.0)
    (second,) = splitter.feed(stream[9:], 4.0)
    assert (first.began, first.ended) == (1.0, 3.0)
    assert (second.began, second.ended) == (3.0, 4.0)
    assert (first.offset, second.offset) == (0, 7)


def test_a_header_alone_is_noticed_for_the_packet_that_it_heads() -> None:
    splitter = Splitter()
    splitter.feed(packet(b"ab") + b"\x02\x00\x00\x00", 1.0)
    (apart,) = splitter.feed(b"cd", 2.0)
    (whole,) = splitter.feed(packet(b"ef"), 3.0)
    assert apart.header_apart
    assert not whole.header_apart


def test_a_write_of_many_packets_may_be_divided_behind_a_header() -> None:
    splitter = Splitter()
    many = packet(b"ab") * 1000
    (*_, last) = splitter.feed(many[:-2], 1.0) + splitter.feed(many[-2:], 2.0)
    assert last.ended == 2.0
    assert not last.header_apart


def test_a_bad_length_ends_the_splitting_and_costs_no_memory() -> None:
    for length in (0, LIMITS["max_payload_bytes"] + 1):
        splitter = Splitter()
        bad = length.to_bytes(4, "little") + b"more"
        assert [p.payload for p in splitter.feed(packet(b"a") + bad, 1.0)] == [b"a"]
        assert splitter.feed(packet(b"b") * 1000, 2.0) == []
        assert (splitter.refused, splitter.rest, splitter.unsplit) == (5, bad, 5000)


def test_the_longest_packet_is_taken() -> None:
    longest = b"x" * LIMITS["max_payload_bytes"]
    (found,) = Splitter().feed(packet(longest), 0.0)
    assert found.payload == longest
