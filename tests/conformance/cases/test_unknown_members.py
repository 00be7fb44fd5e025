"""Messages with members added mean what they meant, and break nothing."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.valid.unknown_members import (
    between_unknown_members,
    known_names,
    nested,
    with_unknown_members,
)
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.json_reading import nesting, read, values
from splatbus_schemas import LIMITS
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
    "welcome": messages.welcome("ipc", ["host_shm", "frames"]),
    "frame": messages.frame(7, 1, 2),
    "scene": REPLY_WITHOUT_ID,
}


def knows(fuller, message):
    """`fuller` has all that `message` has, at every level."""
    if isinstance(message, dict):
        return all(name in fuller and knows(fuller[name], message[name]) for name in message)
    if isinstance(message, list):
        return all(knows(full, bare) for full, bare in zip(fuller, message, strict=True))
    return fuller == message


@pytest.mark.parametrize("name", MESSAGES)
@given(seed=st.integers(0, 2**32))
def test_added_members_change_nothing(name, seed):
    fuller = with_unknown_members(MESSAGES[name], Random(seed))
    assert knows(fuller, MESSAGES[name])
    assert not violations(fuller, name, "1.1")
    value, faults = read(messages.encode(fuller))
    assert (value, faults) == (fuller, ())


@given(seed=st.integers(0, 2**32))
def test_no_name_is_added_that_means_something_there(seed):
    fuller = with_unknown_members(REPLY_WITHOUT_ID, Random(seed))
    assert "id" not in fuller


@pytest.mark.parametrize("name", MESSAGES)
def test_members_before_and_behind_mislead_a_search_of_the_text(name):
    between = between_unknown_members(MESSAGES[name], 4096)
    assert values(between) == 4096
    assert knows(between, MESSAGES[name])
    assert not violations(between, name, "1.1")
    places = list(between)
    own = [places.index(member) for member in MESSAGES[name]]
    assert places.index("decoy") < min(own)
    assert max(own) < places.index("decoy of it")
    assert between["decoy"].keys() == MESSAGES[name].keys() == between["decoy of it"].keys()


@pytest.mark.parametrize("name", MESSAGES)
def test_every_object_gains_a_member(name):
    fuller = with_unknown_members(MESSAGES[name], Random(1))
    pairs = [(fuller, MESSAGES[name])]
    while pairs:
        full, bare = pairs.pop()
        assert len(full) > len(bare)
        pairs += [(full[key], bare[key]) for key in bare if isinstance(bare[key], dict)]


def test_known_names_are_those_of_the_schemas():
    assert {"meta", "fmtColor", "viewport_size", "mem_color", "unitMetres"} <= known_names()
    assert "x-later" not in known_names()


@pytest.mark.parametrize("depth", [1, 2, LIMITS["max_json_depth"]])
def test_nested_is_as_deep_as_asked(depth):
    assert nesting(messages.encode({"x": nested(depth)}).decode()) == depth + 1
