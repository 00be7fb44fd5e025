"""Sound init packets satisfy the schema; broken ones break the requirement that they name."""

import itertools

import pytest
from hypothesis import given
from splatbus_conformance.cases.malformed.init_packets import (
    ROOM,
    beyond_memory,
    breaches_of_1_0,
    breaches_of_1_1,
    changed,
    wrapping_in_32_bits,
)
from splatbus_conformance.cases.valid.init_packets import SEMANTICS, layouts, unusual_packets
from splatbus_schemas.validation import violations

NAMED = {"memory/name": "splatbus-1", "generation": 1}
BREACHES = [*breaches_of_1_0(), *breaches_of_1_1()]


def slots(packet):
    """(begin, end) of every slot, colour first."""
    meta, ring = packet["meta"], packet["ring"]
    for plane, size in (("color", 16), ("depth", 4)):
        for k in range(int(ring["slots"])):
            begin = ring[f"{plane}Offset"] + k * ring[f"{plane}Stride"]
            yield begin, begin + size * meta["w"] * meta["h"]


def whole(packet):
    """All slots lie within the memory, apart from each other."""
    found = sorted(slots(packet))
    apart = all(a[1] <= b[0] for a, b in itertools.pairwise(found))
    return apart and max(end for _, end in found) <= packet["memory"]["bytes"]


@given(layouts())
def test_drawn_layouts_are_sound(packet):
    packet = changed(packet, NAMED)
    assert not violations(packet, "init_packet", "1.1")
    assert whole(packet)
    assert packet["memory"]["bytes"] <= ROOM


@pytest.mark.parametrize(("what", "packet"), unusual_packets())
def test_unusual_packets_are_sound(what, packet):
    packet = changed(packet, NAMED)
    assert not violations(packet, "init_packet", "1.1")
    assert whole(packet)


@pytest.mark.parametrize("changes", SEMANTICS)
def test_other_semantics_are_sound(changes):
    packet = changed(unusual_packets()[0][1], NAMED | changes)
    assert not violations(packet, "init_packet", "1.1")


@pytest.mark.parametrize("breach", BREACHES, ids=lambda breach: breach.what)
def test_a_breach_breaks_what_it_names_and_nothing_else(breach):
    packet = breach.packet("splatbus-1", 1)
    found = violations(packet, "init_packet", "1.1")
    named = {requirement for violation in found for requirement in violation.requirements}
    meta, ring = packet.get("meta"), packet.get("ring")
    if found:
        assert breach.requirement in named
    elif breach.requirement == "INI-4":
        assert (meta["pitchColor"], meta["pitchDepth"]) != (16 * meta["w"], 4 * meta["w"])
    elif breach.requirement == "MEM-8":
        size = meta["w"] * meta["h"]
        assert ring["colorStride"] < 16 * size or ring["depthStride"] < 4 * size
    else:
        assert breach.requirement == "MEM-9"
        assert not whole(packet)


@pytest.mark.parametrize(
    "breach", [*beyond_memory(), *wrapping_in_32_bits()], ids=lambda breach: breach.what
)
def test_rings_beyond_memory(breach):
    packet = breach.packet("splatbus-1", 1)
    assert bool(violations(packet, "init_packet", "1.1")) == (breach.requirement == "MEM-8")
    beyond = max(end for _, end in slots(packet)) > packet["memory"]["bytes"]
    assert beyond or packet["memory"]["bytes"] > ROOM


@pytest.mark.parametrize("breach", wrapping_in_32_bits(), ids=lambda breach: breach.what)
def test_in_32_bits_they_look_small(breach):
    """What a client that keeps every number in 32 bits, signed, makes of the packet."""
    packet = breach.packet("splatbus-1", 1)
    meta, ring = packet["meta"], packet["ring"]

    def wrapped(value):
        return (value + 2**31) % 2**32 - 2**31

    for plane, size in (("color", 16), ("depth", 4)):
        offset, stride = wrapped(ring[f"{plane}Offset"]), wrapped(ring[f"{plane}Stride"])
        image = wrapped(size * meta["w"] * meta["h"])
        end = wrapped(offset + (ring["slots"] - 1) * stride + image)
        assert end <= wrapped(packet["memory"]["bytes"])
