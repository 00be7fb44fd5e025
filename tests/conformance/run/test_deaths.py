"""A process that ends within a packet is not charged with the half that it sent (FRM-1)."""

import math
import shlex
import sys
from typing import Any

import pytest
from splatbus_conformance.rules.v1_0.frm import whole_packets
from splatbus_conformance.run.deaths import note_deaths
from splatbus_conformance.trials.testee.process import Launched
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.recording import Entry

from tests.waiting import eventually


def connection(number: int, began: float) -> list[Entry]:
    half = Entry(began + 1.0, "msg", number, "c2s", b"\x1c\x00\x00\x00{")
    return [Entry(began, "msg", number, event="open"), half]


SESSION = [*connection(1, 1.0), Entry(3.0, "msg", 1, "c2s", event="eof")]
NEXT = connection(2, 5.0)


@pytest.mark.parametrize(
    ("more", "lives", "accused"),
    [
        pytest.param([], [(0.0, math.inf)], True, id="it runs"),
        pytest.param([], [(0.0, 4.0)], False, id="it ended"),
        pytest.param(NEXT, [(0.0, 4.0), (4.0, math.inf)], False, id="another runs"),
        pytest.param(NEXT, [(0.0, 7.0)], True, id="it ended later, after it had said more"),
        pytest.param([], [], True, id="somebody else started it"),
    ],
)
def test_half_a_packet_is_held_against_who_lives(more: Any, lives: Any, accused: bool) -> None:
    entries = [*SESSION, *more]
    recorded = conversations(entries)
    note_deaths(recorded, entries, "c2s", lives)
    codes = [it.breach.code for it in whole_packets(recorded[0]) if it.breach]
    assert codes == ["cut-short"] * accused


def test_a_launched_testee_tells_its_lives() -> None:
    testee = Launched(f"{shlex.quote(sys.executable)} -c pass", {})
    testee.ensure_running()
    assert eventually(testee.ended)
    testee.ensure_running()
    (born, ended), (again, _) = testee.lives
    assert born < ended == again
    testee.stop()
    assert testee.lives[1][1] < math.inf
    testee.close()
