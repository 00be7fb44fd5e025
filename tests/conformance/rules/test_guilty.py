"""What of a recording a failure is about: what we sent that is wrong or last, and what came."""

import pickle

import pytest
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.rules import sightings
from splatbus_conformance.rules.guilty import mark, marks
from splatbus_conformance.rules.tally import result, rules_on, tally
from splatbus_conformance.wire.conversation import conversations

from tests.conformance.rules.talk import ASK_SIZE, POSE, SIZE, Entry, client, ipc, msg, raw, server

ASKS, GOOD, BAD = client(ASK_SIZE), server(SIZE), server({"viewport_size": [64, -48]})
TURNED = client({**POSE, "rotation": {}})
LENGTH = len(GOOD.data or b"")
ABOUT = {
    "wrong, and not the control after it": (
        *(msg(ASKS, BAD, ASKS, GOOD), "REQ-13", 0),
        [("s2c", 0, "/viewport_size/1")],
    ),
    "a header that is none": (ipc(raw("s2c", b"\0" * 4), GOOD), "FRM-3", 0, [("s2c", 0, "")]),
    "one behind another": (
        msg(ASKS, GOOD, raw("s2c", b"\0" * 4)),
        "FRM-3",
        0,
        [("s2c", LENGTH, "")],
    ),
    "the last, where all is right": (
        *(msg(ASKS, GOOD, ASKS, GOOD, ASKS), "REQ-13", 0),
        [("s2c", LENGTH, "")],
    ),
    "not of an earlier case": (
        *(msg(ASKS, BAD, ASKS, GOOD), "REQ-13", 4),
        [("s2c", len(BAD.data or b""), "")],
    ),
    "of the testee, what breaks the requirement": (
        *(msg(TURNED, ASKS, GOOD), "POS-1", 0),
        [("s2c", 0, ""), ("c2s", 0, "/rotation/x")],
    ),
    "of the testee, nothing else": (msg(TURNED, ASKS, GOOD), "POS-2", 0, [("s2c", 0, "")]),
}


@pytest.mark.parametrize(("entries", "requirement", "since", "expected"), ABOUT.values(), ids=ABOUT)
def test_a_failure_is_about(
    entries: list[Entry], requirement: str, since: int, expected: list[tuple[str, int, str]]
) -> None:
    found = marks(entries, "s2c", requirement, since)
    assert [(it.dir, it.offset, it.pointer) for it in found] == expected
    assert {(it.channel, it.conn) for it in found} == {(entries[0].channel, 1)}


def test_what_did_not_come_has_no_place() -> None:
    for sighting in sightings(msg(ASKS, ASKS, GOOD, GOOD, GOOD)):
        assert (mark(sighting) is None) == (sighting.message is None and not sighting.data)


def test_what_a_rule_counted_shows_the_bytes_of_the_first_also_in_another_process() -> None:
    recorded = conversations(msg(ASKS, BAD, ASKS, BAD))
    there = Traffic(tally=tally(recorded, "server", rules_on({"REQ-3", "REQ-4"})))
    here = Traffic()
    here.add(pickle.loads(pickle.dumps(there)))
    here.add(there)
    assert here.tally.keys() == {"REQ-3"}
    told = result("REQ-3", here.tally["REQ-3"], "MUST")
    assert told.code == "out-of-range"
    assert "4 of 4" in told.text
    assert any("-48" in line for line in told.evidence)
