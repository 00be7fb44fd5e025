"""How many cases a check goes through, and what is left of a testee that it ends."""

import sys

import pytest
from hypothesis import strategies as st
from splatbus_conformance.cases.script import Case
from splatbus_conformance.trials.testee.process import Awaited, Ended, Launched
from splatbus_conformance.trials.trial import Stand, Trial, Violation
from splatbus_conformance.wire.sockets import Peer
from splatbus_schemas.requirements import requirements

from tests.waiting import eventually

LISTED = range(100, 110)
SMALL = st.integers(0, 99)


@pytest.fixture
def trial():
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    yield Trial(requirements("1.1")["FRM-3"], Stand(peer, Awaited("nobody"), 1.0))
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


@pytest.mark.parametrize("seed", range(4))
def test_quick_delivers_one_listed_case_of_each_kind_whatever_a_testee_affords(trial, seed) -> None:
    trial.seed, trial.affords = seed, lambda: False
    few = list(trial.each(LISTED, kind=lambda case: "extreme" if case == 109 else case % 2))
    assert len(few) == 3
    assert 109 in few
    assert {case % 2 for case in few} == {0, 1}
    assert trial.left_out == len(LISTED) - 3


def test_other_seeds_deliver_other_listed_cases_and_the_full_profile_all(trial) -> None:
    seen = set[int]()
    for trial.seed in range(len(LISTED)):
        seen |= set(trial.each(LISTED, kind=lambda case: "all of one kind", spare=1))
    assert seen == set(LISTED)
    trial.profile, trial.left_out = "full", 0
    assert list(trial.each(LISTED, kind=lambda case: 0, spare=0)) == [*LISTED]
    assert trial.left_out == 0


CONNECTS = """
import os, pathlib, socket, sys, time
address = os.environ["SPLATBUS_HOST"], int(os.environ["SPLATBUS_IPC_PORT"])
with socket.create_connection(address):
    pathlib.Path(sys.argv[1]).touch()
    time.sleep(60)
"""


def test_what_an_ended_testee_had_begun_is_not_taken_for_its_successors(trial, tmp_path) -> None:
    """Its connection was made, and not accepted yet, when it was ended."""
    program, connected = tmp_path / "connects.py", tmp_path / "connected"
    program.write_text(CONNECTS)
    trial.peer.listen("ipc")
    command = f'"{sys.executable}" "{program}" "{connected}"'
    trial.testee = Launched(command, trial.peer.environment())
    try:
        trial.testee.ensure_running()
        assert eventually(connected.exists)
        trial.end_testee()
        assert [connection.open for connection in trial.peer.connections] == [False]
        trial.rest(0.1)
        assert len(trial.peer.connections) == 1
    finally:
        trial.testee.close()


def test_a_process_that_has_ended_does_not_hang(trial) -> None:
    trial.testee.ended = lambda: Ended(-6, crashed=True)
    with pytest.raises(Violation) as found:
        trial.judge("hangs", "a frame")
    assert found.value.code == "dies"
