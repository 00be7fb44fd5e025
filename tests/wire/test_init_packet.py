import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_schemas import LIMITS, examples
from splatbus_schemas.validation import violations
from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import PacketDecoder
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
from splatbus_wire.messages import decode_from_server_ipc, encode
from splatbus_wire.semantics import Semantics

from tests.wire import strategies

LEGACY = init_packet_object(
    InitPacket(64, 48, LegacyBuffers(*(bytes([n]) * 64 for n in (1, 2, 3))))
)
RING, BYTES = host_ring(320, 240, 3)
HOST_PACKET = InitPacket(
    320, 240, None, "1.1", 1, HostMemory("splatbus-3f9a1c-1", BYTES), RING, Semantics()
)
HOST = init_packet_object(HOST_PACKET)
CUDA_PACKET = InitPacket(
    64,
    48,
    parse_init_packet(LEGACY).legacy,
    "1.1",
    1,
    CudaMemory("GPU-01234567-89ab-cdef-0123-456789abcdef", b"\x04" * 64, 122_880),
    Slots(2, 0, 49_152, 98_304, 12_288, (bytes(64), b"\xff" * 64)),
    Semantics(depth_empty=100.0, unit_metres=0.5),
)
CUDA = init_packet_object(CUDA_PACKET)


NO_VERSIONS = ("1.0", "1.01", "1.1.2", "1.x", "1.", "1.2 ", "1.2\n", "1.٢", "2.0", "2.2", "", 1.2)


def with_value(message: dict, pointer: str, value: object) -> dict:
    """The message with `value` where the pointer leads, or with nothing there for `...`."""
    changed = json.loads(json.dumps(message))
    *path, last = pointer[1:].split("/")
    place = changed
    for name in path:
        place = place[int(name) if isinstance(place, list) else name]
    if value is ...:
        del place[last]
    else:
        place[int(last) if isinstance(place, list) else last] = value
    return changed


def refusal(message: dict) -> ProtocolError:
    with pytest.raises(ProtocolError) as caught:
        parse_init_packet(message)
    assert caught.value.code == "invalid_message"
    return caught.value


@given(strategies.init_packets())
def test_init_packets_survive_the_wire(packet):
    decoder = PacketDecoder()
    decoder.receive(encode(packet))
    payload = decoder.next_packet()
    assert payload is not None
    assert decode_from_server_ipc(payload) == packet
    assert violations(json.loads(payload), "init_packet", packet.version or "1.0") == []


def test_absent_offsets_are_zero_and_an_absent_device_is_unknown():
    bare = with_value(with_value(LEGACY, "/meta/offsetColor", ...), "/meta/offsetDepth", ...)
    legacy = parse_init_packet(bare).legacy
    assert legacy is not None
    assert (legacy.offset_color, legacy.offset_depth, legacy.device) == (0, 0, None)


def test_integers_may_have_a_fraction_of_zero():
    packet = parse_init_packet(with_value(with_value(LEGACY, "/meta/w", 64.0), "/meta/device", 3.0))
    assert packet.width == 64
    assert type(packet.width) is int
    assert packet.legacy is not None
    assert packet.legacy.device == 3


def test_unknown_members_are_ignored_at_every_level():
    for place in ("", "/meta", "/memory", "/ring", "/semantics", "/semantics/depth"):
        assert parse_init_packet(with_value(HOST, f"{place}/later", [None])) == HOST_PACKET


@pytest.mark.parametrize("version", ["1.2", "1.10", "1.100", "1." + "9" * 5000])
def test_a_later_version_is_taken_for_ones_own_by_the_members_that_are_known(version):
    later = with_value(HOST, "/memory/later", [None]) | {"version": version, "later": {}}
    assert parse_init_packet(later) == HOST_PACKET


@pytest.mark.parametrize("kind", ["init", "", None, 7])
def test_what_has_a_type_is_no_init_packet(kind):
    for message in (LEGACY, HOST):
        with pytest.raises(ProtocolError) as caught:
            decode_from_server_ipc(json.dumps(message | {"type": kind}).encode())
        assert (caught.value.code, caught.value.requirement) == ("unknown_type", "INI-11")


def test_without_version_what_follows_is_not_known():
    stray = LEGACY | {"generation": "x", "memory": None, "ring": 1, "semantics": []}
    assert parse_init_packet(stray) == parse_init_packet(LEGACY)


@pytest.mark.parametrize(
    ("message", "pointer", "value", "requirement"),
    [
        (LEGACY, "/meta/pitchColor", 1040, "INI-4"),
        (LEGACY, "/meta/pitchDepth", 1024, "INI-4"),
        (LEGACY, "/mem_color", "A" * 85 + "B==", "INI-7"),
        *((HOST, "/version", version, "MEM-1") for version in NO_VERSIONS),
        (HOST, "/ring/colorStride", 16 * 320 * 240 - 16, "MEM-8"),
        (HOST, "/ring/depthStride", 4 * 320 * 240 - 16, "MEM-8"),
        (CUDA, "/memory/handle", "A" * 85 + "B==", "MEM-2"),
    ],
)  # fmt: skip
def test_what_breaks_a_rule_is_refused_with_pointer_and_requirement(
    message, pointer, value, requirement
):
    parse_init_packet(message)
    error = refusal(with_value(message, pointer, value))
    assert (error.requirement, error.pointer) == (requirement, pointer)
    assert len(str(error)) < 200


@pytest.mark.parametrize(
    ("message", "pointer", "value"),
    [
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


def test_the_offsets_of_1_0_move_the_legacy_buffers_and_not_the_ring():
    packet = parse_init_packet(with_value(CUDA, "/meta/offsetColor", 512))
    assert packet.legacy is not None
    assert packet.legacy.offset_color == 512
    assert packet.ring == CUDA_PACKET.ring


def test_events_are_as_many_as_slots():
    assert refusal(with_value(CUDA, "/ring/slots", 1)).pointer == "/ring/events"


def test_cuda_memory_may_come_without_a_ring():
    assert parse_init_packet(with_value(CUDA, "/ring", ...)).ring is None


def test_an_empty_depth_may_be_infinite_or_a_number():
    for spelt, depth in (("inf", math.inf), (100, 100.0), (0.0, 0.0)):
        found = parse_init_packet(with_value(HOST, "/semantics/depth/empty", spelt)).semantics
        assert found is not None
        assert found.depth_empty == depth


# host_ring, check_fits


@given(strategies.sizes(1), strategies.sizes(1), st.integers(1, LIMITS["max_slots"]))
def test_a_host_ring_fits_exactly(width, height, slots):
    ring, size = host_ring(width, height, slots)
    assert {ring.color_offset % 16, ring.color_stride % 16} == {0}
    assert {ring.depth_offset % 16, ring.depth_stride % 16} == {0}
    packet = InitPacket(width, height, None, "1.1", 1, HostMemory("a", size), ring, Semantics())
    check_fits(packet, size)
    check_fits(packet, size + 4096)
    assert size - 20 * width * height * slots < 16 * slots


def test_the_example_of_the_specification_is_a_host_ring():
    assert host_ring(320, 240, 3) == (Slots(3, 0, 1_228_800, 3_686_400, 307_200), 4_608_000)


def misfit(packet: InitPacket, actual_bytes: int) -> ProtocolError:
    with pytest.raises(ProtocolError) as caught:
        check_fits(packet, actual_bytes)
    return caught.value


def test_memory_that_is_shorter_than_announced_does_not_fit():
    error = misfit(HOST_PACKET, 4096)
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
    error = misfit(HOST_PACKET._replace(ring=RING._replace(**change)), BYTES)
    assert (error.requirement, error.pointer) == (requirement, pointer)


@given(strategies.rings(4, 3), st.integers(200, 2000))
def test_a_ring_fits_if_no_byte_is_shared_or_beyond_the_end(ring, size):
    used = [
        offset + slot * stride + byte
        for offset, stride, image_bytes in (
            (ring.color_offset, ring.color_stride, 16 * 4 * 3),
            (ring.depth_offset, ring.depth_stride, 4 * 4 * 3),
        )
        for slot in range(ring.slots)
        for byte in range(image_bytes)
    ]
    fits = len(set(used)) == len(used) and max(used) < size
    packet = InitPacket(4, 3, None, "1.1", 1, HostMemory("a", size), ring, Semantics())
    if fits:
        check_fits(packet, size)
    else:
        assert misfit(packet, size).requirement in ("MEM-9", "MEM-10")


def test_a_packet_of_1_0_has_nothing_to_check():
    check_fits(parse_init_packet(LEGACY), 0)


# readable_generation


def test_the_generation_of_a_refused_packet_is_readable():
    broken = with_value(HOST, "/memory/name", "../x")
    assert readable_generation(broken) == 1


@pytest.mark.parametrize(
    "message",
    [
        {"meta": {}},
        {"meta": {}, "generation": 0},
        {"meta": {}, "generation": "1"},
        {"generation": 1},
        {"meta": {}, "generation": 1, "type": "scene"},
    ],
)
def test_no_generation_is_read_from_what_has_none(message):
    assert readable_generation(message) is None


def test_every_valid_example_is_taken():
    for version in ("1.0", "1.1"):
        for example in examples("init_packet", version)[0]:
            if version == "1.0" and "version" in example.message:
                continue  # to a receiver of 1.1 that is no unknown member
            taken_for = "1.1" if "version" in example.message else None
            assert parse_init_packet(example.message).version == taken_for
