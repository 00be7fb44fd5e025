"""How many cases a check goes through."""

import pytest
from hypothesis import strategies as st
from splatbus_conformance.peer import Peer
from splatbus_conformance.script import Case
from splatbus_conformance.testee import Awaited
from splatbus_conformance.trial import Trial
from splatbus_schemas.requirements import requirements

LISTED = range(100, 110)
SMALL = st.integers(0, 99)


@pytest.fixture
def trial():
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    yield Trial(requirements("1.1")["FRM-3"], peer, Awaited("nobody"), 1.0)
    peer.close()


@pytest.mark.parametrize(
    ("profile", "listed", "drawn"),
    [("brief", [100, 104, 108], 3), ("quick", [*LISTED], 10), ("full", [*LISTED], 40)],
)
def test_a_profile_decides_how_many_cases(trial, profile, listed, drawn) -> None:
    trial.profile = profile
    cases = list(trial.each(LISTED, SMALL, quick=10, full=40))
    assert cases[: len(listed)] == listed
    assert len(cases) == len(listed) + drawn
    assert len(trial.went_through[0]) == len(cases)


def test_a_script_decides_for_any_profile(trial) -> None:
    trial.profile = "brief"
    trial.script = ((Case(False, 1), Case(True, 7), Case(False, 2), Case(False, 99)),)
    assert list(trial.each(LISTED, SMALL, quick=10, full=40)) == [101, 7, 102]
