"""Messages with members added mean what they meant, and break nothing."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.valid.unknown_members import (
    between_unknown_members,
    with_unknown_members,
)
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.json_reading import read, values
from splatbus_schemas.validation import violations

REPLY_WITHOUT_ID = {
    "type": "scene",
    "objects": [{"id": "default", "name": "", "gaussians": 1, "bounds": None}],
    "timeRange": None,
    "cameras": 0,
    "origin": [0.0, 0.0, 0.0],
}
MESSAGES = {
    "init_packet": messages.init_packet_1_1("splatbus-1", 7),
    "frame": messages.frame(7, 1, 2),
    "scene": REPLY_WITHOUT_ID,
}


def knows(fuller, message, more=0):
    """`fuller` has all that `message` has, and so many members more, at every level."""
    if isinstance(message, dict):
        inside = all(
            name in fuller and knows(fuller[name], message[name], more) for name in message
        )
        return inside and len(fuller) >= len(message) + more
    if isinstance(message, list):
        return all(knows(full, bare, more) for full, bare in zip(fuller, message, strict=True))
    return fuller == message


@pytest.mark.parametrize("name", MESSAGES)
@given(seed=st.integers(0, 2**32))
def test_added_members_change_nothing(name, seed):
    fuller = with_unknown_members(MESSAGES[name], Random(seed))
    assert knows(fuller, MESSAGES[name], 1)
    assert not violations(fuller, name, "1.1")
    assert read(messages.encode(fuller)) == (fuller, ())
    assert "id" not in fuller  # of a reply it means something


@pytest.mark.parametrize("name", MESSAGES)
def test_members_before_and_behind_mislead_a_search_of_the_text(name):
    between = between_unknown_members(MESSAGES[name], 4096)
    assert values(between) == 4096
    assert knows(between, MESSAGES[name])
    assert not violations(between, name, "1.1")
    first, decoy, *own, behind, last = between
    assert (first, decoy, own, behind, last) == (
        "",
        "decoy",
        [*MESSAGES[name]],
        "decoy of it",
        "x-later",
    )
    assert between[decoy].keys() == MESSAGES[name].keys() == between[behind].keys()
