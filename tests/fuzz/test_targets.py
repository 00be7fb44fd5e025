"""Every target for a moment, with the same inputs each time; and whether it sees what is broken."""

from __future__ import annotations

import json
from typing import Any
from unittest import mock

import pytest
import splatbus_conformance.wire.json_reading
import splatbus_conformance.wire.recording
import splatbus_wire.framing
import splatbus_wire.json_text
import splatbus_wire.plain_poses

from tests.fuzz import corpus
from tests.fuzz.loop import fuzz
from tests.fuzz.targets import TARGETS

EXECUTIONS = {"recorded": 500, "reported": 500, "scripted": 500}
USUAL = 2500
"""Of which some 900 or 1700 are what the target begins with."""
MOST_BYTES = 300_000
"""Of what the repository keeps of all inputs."""


@pytest.mark.parametrize("name", TARGETS)
def test_no_reader_fails_in_a_way_of_its_own(name: str) -> None:
    """What was found before is among what a target begins with."""
    result = fuzz(name, executions=EXECUTIONS.get(name, USUAL), traces=False)
    assert not result.faults, result.faults


def test_the_corpus_is_small() -> None:
    assert sum(path.stat().st_size for path in corpus.FOLDER.iterdir()) <= MOST_BYTES
    assert {path.stem for path in corpus.FOLDER.iterdir()} <= set(TARGETS)


def _whatever(*_: Any) -> None:
    return None


PLANTED = {
    "depth": ("leniently", splatbus_wire.json_text, "check_depth", _whatever),
    "half a pair": ("leniently", splatbus_wire.json_text, "_check_pairs", _whatever),
    "a name twice": ("leniently", splatbus_wire.json_text, "STRICT", json.JSONDecoder()),
    "lenient": ("leniently", splatbus_conformance.wire.json_reading, "LONG_NUMBER", 10**6),
    "largest": ("streamed", splatbus_wire.framing, "MAX_PAYLOAD_BYTES", 1 << 30),
    "a recording": (
        *("recorded", splatbus_conformance.wire.recording),
        *("_is_number", lambda value: not isinstance(value, str)),
    ),
}


@pytest.mark.parametrize("what", PLANTED)
def test_a_fault_is_found(what: str) -> None:
    name, module, attribute, broken = PLANTED[what]
    with mock.patch.object(module, attribute, broken):
        tries = (fuzz(name, executions=2000, seed=seed, most_faults=1) for seed in range(20))
        assert any(found.faults for found in tries)
