import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_schemas import LIMITS, examples
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
from tests.wire.payloads import refusal, with_value

LEGACY_PACKET = InitPacket(64, 48, LegacyBuffers(*(bytes([n]) * 64 for n in (1, 2, 3))))
LEGACY = init_packet_object(LEGACY_PACKET)
RING, BYTES = host_ring(320, 240, 3)
HOST_PACKET = InitPacket(
    320, 240, None, "1.1", 1, HostMemory("splatbus-3f9a1c-1", BYTES), RING, Semantics()
)
HOST = init_packet_object(HOST_PACKET)
CUDA_PACKET = InitPacket(
    64,
    48,
    LEGACY_PACKET.legacy,
    "1.1",
    1,
    CudaMemory("GPU-01234567-89ab-cdef-0123-456789abcdef", b"\x04" * 64, 122_880),
    Slots(2, 0, 49_152, 98_304, 12_288, (bytes(64), b"\xff" * 64)),
    Semantics(depth_empty=100.0, unit_metres=0.5),
)
CUDA = init_packet_object(CUDA_PACKET)


NO_VERSIONS = ("1.0", "1.01", "1.1.2", "1.x", "1.", "1.2 ", "1.2\n", "1.٢", "2.0", "2.2", "", 1.2)


@pytest.mark.parametrize("packet", [LEGACY_PACKET, HOST_PACKET, CUDA_PACKET])
def test_each_handle_and_place_comes_back_as_what_it_was(packet):
    assert parse_init_packet(init_packet_object(packet)) == packet


@pytest.mark.parametrize("version", NO_VERSIONS)
def test_a_version_of_no_later_1_x_is_refused(version):
    error = refusal(parse_init_packet, HOST | {"version": version})
    assert (error.requirement, error.pointer) == ("MEM-1", "/version")
    assert len(str(error)) < 200


@pytest.mark.parametrize("version", ["1.2", "1.10", "1.100", "1." + "9" * 5000])
def test_a_later_version_is_taken_for_ones_own_by_the_members_that_are_known(version):
    later = with_value(HOST, "/memory/later", [None]) | {"version": version, "later": {}}
    assert parse_init_packet(later) == HOST_PACKET


@pytest.mark.parametrize(
    ("message", "pointer", "value"),
    [
        *((LEGACY, f"/{name}", "x") for name in ("generation", "memory", "ring", "semantics")),
        *(
            (HOST, f"{place}/later", [None])
            for place in ("", "/meta", "/memory", "/ring", "/semantics", "/semantics/depth")
        ),
        (HOST, "/memory/deviceUuid", 7),
        (HOST, "/memory/handle", "none"),
        (HOST, "/ring/events", None),
        (HOST, "/meta/offsetColor", 16),
        (HOST, "/meta/offsetDepth", 1_228_800),
        (CUDA, "/memory/name", "../../etc/passwd"),
    ],
)
def test_what_means_nothing_in_this_kind_of_memory_is_ignored(message, pointer, value):
    assert parse_init_packet(with_value(message, pointer, value)) == parse_init_packet(message)


def test_absent_offsets_are_zero_an_absent_device_unknown_and_integers_may_have_a_fraction():
    meta = {name: LEGACY["meta"][name] for name in LEGACY["meta"] if "offset" not in name}
    packet = parse_init_packet(LEGACY | {"meta": meta | {"w": 64.0}})
    assert type(packet.width) is int
    assert packet.legacy[3:] == (0, 0, None)
    assert parse_init_packet(with_value(LEGACY, "/meta/device", 3.0)).legacy.device == 3


def test_the_offsets_of_1_0_move_the_legacy_buffers_and_not_the_ring():
    packet = parse_init_packet(with_value(CUDA, "/meta/offsetColor", 512))
    assert packet.legacy.offset_color == 512
    assert packet.ring == CUDA_PACKET.ring


@pytest.mark.parametrize(("spelt", "depth"), [("inf", math.inf), (100, 100.0), (0.0, 0.0)])
def test_an_empty_depth_may_be_infinite_or_a_number(spelt, depth):
    packet = parse_init_packet(with_value(HOST, "/semantics/depth/empty", spelt))
    assert packet.semantics.depth_empty == depth


def test_every_valid_example_is_taken_for_its_version():
    for version in ("1.0", "1.1"):
        for example in examples("init_packet", version)[0]:
            if version == "1.0" and "version" in example.message:
                continue  # to a receiver of 1.1 that is no unknown member
            taken_for = "1.1" if "version" in example.message else None
            assert parse_init_packet(example.message).version == taken_for


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


def test_memory_that_is_shorter_than_announced_does_not_fit():
    error = refusal(check_fits, HOST_PACKET, 4096)
    assert (error.requirement, error.pointer) == ("MEM-6", "/memory/bytes")
    assert error.message == f"memory is 4096 bytes long, {BYTES} were announced"


@pytest.mark.parametrize(
    ("change", "requirement", "pointer"),
    [
        ({"slots": 4}, "MEM-10", "/ring/colorOffset"),
        ({"color_offset": 2**53 - 16}, "MEM-10", "/ring/colorOffset"),
        ({"depth_stride": 2**53 - 16}, "MEM-10", "/ring/depthOffset"),
        ({"depth_offset": RING.depth_offset + 16}, "MEM-10", "/ring/depthOffset"),
        ({"depth_offset": RING.depth_offset - 16}, "MEM-9", "/ring"),
        ({"color_offset": 16}, "MEM-9", "/ring"),
        ({"depth_offset": 0}, "MEM-9", "/ring"),
    ],
)
def test_slots_that_leave_the_memory_or_overlap_do_not_fit(change, requirement, pointer):
    error = refusal(check_fits, HOST_PACKET._replace(ring=RING._replace(**change)), BYTES)
    assert (error.requirement, error.pointer) == (requirement, pointer)


def test_a_packet_of_1_0_has_nothing_to_check():
    check_fits(parse_init_packet(LEGACY), 0)


@pytest.mark.parametrize(
    ("message", "generation"),
    [
        (with_value(HOST, "/memory/name", "../x"), 1),
        ({"meta": {}}, None),
        ({"meta": {}, "generation": 0}, None),
        ({"meta": {}, "generation": "1"}, None),
        ({"generation": 1}, None),
        ({"meta": {}, "generation": 1, "type": "scene"}, None),
    ],
)
def test_the_generation_of_a_refused_packet_is_read_where_it_has_one(message, generation):
    assert readable_generation(message) == generation
