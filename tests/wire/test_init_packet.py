import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_wire.init_packet import (
    CudaMemory,
    HostMemory,
    InitPacket,
    LegacyBuffers,
    Slots,
    check_fits,
    host_ring,
    init_packet_object,
    parse_init_packet,
    readable_generation,
)
from splatbus_wire.semantics import Semantics

from tests.wire import strategies
from tests.wire.payloads import with_value

LEGACY_PACKET = InitPacket(64, 48, LegacyBuffers(*(bytes([n]) * 64 for n in (1, 2, 3))))
LEGACY = init_packet_object(LEGACY_PACKET)
RING, BYTES = host_ring(320, 240, 3)
HOST = init_packet_object(
    InitPacket(320, 240, None, "1.1", 1, HostMemory("splatbus-3f9a1c-1", BYTES), RING, Semantics())
)
CUDA = init_packet_object(
    InitPacket(
        64,
        48,
        LEGACY_PACKET.legacy,
        "1.1",
        1,
        CudaMemory("GPU-01234567-89ab-cdef-0123-456789abcdef", b"\x04" * 64, 122_880),
        Slots(2, 0, 49_152, 98_304, 12_288, (bytes(64), b"\xff" * 64)),
        Semantics(depth_empty=100.0, unit_metres=0.5),
    )
)
NO_VERSIONS = ("1.0", "1.01", "1.1.2", "1.x", "1.", "1.2 ", "1.2\n", "1.٢", "2.0", "2.2", "", 1.2)


@pytest.mark.parametrize(
    ("message", "pointer", "value"),
    [
        *((LEGACY, f"/{name}", "x") for name in ("generation", "memory", "ring", "semantics")),
        (HOST, "/memory/deviceUuid", 7),
        (HOST, "/memory/handle", "none"),
        (CUDA, "/memory/name", "../../etc/passwd"),
    ],
)
def test_what_means_nothing_in_this_kind_of_memory_is_ignored(message, pointer, value):
    assert parse_init_packet(with_value(message, pointer, value)) == parse_init_packet(message)


@given(strategies.sizes(1), strategies.sizes(1), st.integers(1, LIMITS["max_slots"]))
def test_a_host_ring_fits_exactly(width, height, slots):
    ring, size = host_ring(width, height, slots)
    assert [number % 16 for number in ring[1:5]] == [0] * 4
    packet = InitPacket(width, height, None, "1.1", 1, HostMemory("a", size), ring, Semantics())
    check_fits(packet, size)
    check_fits(packet, size + 4096)
    assert size - 20 * width * height * slots < 16 * slots


def test_the_example_of_the_specification_is_a_host_ring():
    assert host_ring(320, 240, 3) == (Slots(3, 0, 1_228_800, 3_686_400, 307_200), 4_608_000)


def test_the_generation_of_a_refused_packet_is_read_where_it_has_one():
    refused = with_value(HOST, "/memory/name", "../x")
    for generation, read in ((1, 1), (0, None), ("1", None), (..., None)):
        assert readable_generation(with_value(refused, "/generation", generation)) == read
