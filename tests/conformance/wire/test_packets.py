"""The judge's own reading of packets."""

from itertools import accumulate, pairwise

from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.wire.packets import Splitter, packet
from splatbus_schemas import LIMITS

PAYLOADS = st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=5)


@given(PAYLOADS, st.lists(st.integers(0, 230), max_size=8))
def test_packets_are_the_same_however_the_stream_is_cut(
    payloads: list[bytes], cuts: list[int]
) -> None:
    """And each knows when its first and its last byte arrived."""
    stream = b"".join(map(packet, payloads))
    places = sorted({0, len(stream), *(cut for cut in cuts if cut < len(stream))})
    splitter, came = Splitter(), dict[int, float]()
    found = []
    for now, (begin, end) in enumerate(pairwise(places)):
        found += splitter.feed(stream[begin:end], float(now))
        came |= dict.fromkeys(range(begin, end), float(now))
    assert [each.payload for each in found] == payloads
    begins = [0, *accumulate(4 + len(it) for it in payloads)]
    assert [each.offset for each in found] == begins[:-1]
    assert [(it.began, it.ended) for it in found] == [
        (came[begin], came[end - 1]) for begin, end in pairwise(begins)
    ]
    assert (splitter.rest, splitter.offset) == (b"", len(stream))
    assert stream[:4] == len(payloads[0]).to_bytes(4, "little")


def test_a_header_alone_is_noticed_for_the_packet_that_it_heads() -> None:
    splitter = Splitter()
    splitter.feed(packet(b"ab") + b"\x02\x00\x00\x00", 1.0)
    (apart,) = splitter.feed(b"cd", 2.0)
    many = packet(b"ab") * 1000  # such a write may be divided behind a header by chance
    (*_, last) = splitter.feed(many[:-2], 1.0) + splitter.feed(many[-2:], 2.0)
    assert apart.header_apart
    assert not last.header_apart


def test_a_bad_length_ends_the_splitting_and_costs_no_memory() -> None:
    longest = b"x" * LIMITS["max_payload_bytes"]
    for length in (0, len(longest) + 1):
        splitter = Splitter()
        bad = length.to_bytes(4, "little") + b"more"
        assert [it.payload for it in splitter.feed(packet(longest) + bad, 1.0)] == [longest]
        assert splitter.feed(packet(b"b") * 1000, 2.0) == []
        assert (splitter.refused, splitter.rest) == (4 + len(longest), bad)
        assert splitter.unsplit == 5000
