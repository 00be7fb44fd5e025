"""What a run has come to no word on: every requirement has a verdict, a skip or a reason here."""

import io

import pytest
from splatbus_conformance.checks.registry import exclusions, judges
from splatbus_conformance.plan import SIDES
from splatbus_conformance.reports.console import CleanConsole
from splatbus_conformance.reports.terminal import print_unseen
from splatbus_conformance.reports.unseen import NOT_RUN, NOTHING_CAME, NOWHERE, unseen
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements


@pytest.mark.parametrize("side", SIDES)
def test_each_requirement_that_nothing_was_said_of_has_one_reason(side):
    judged = {name: it for name, it in requirements("1.1").items() if side in it.binds}
    found = unseen([], judged, side)
    assert sorted(name for names in found.values() for name in names) == sorted(judged)
    for reason, names in found.items():
        for name in names:
            levels = {judge.level for judge in judges(side).get(name, [])}
            assert reason.startswith(NOWHERE) is (name in exclusions(side))
            assert reason.startswith(NOWHERE) or (reason == NOTHING_CAME) is (levels == {"L0"})
    assert NOT_RUN in found


@pytest.mark.parametrize("verdict", Verdict)
def test_what_a_check_has_said_is_not_said_again(verdict):
    known = requirements("1.1")
    judged = {name: known[name] for name in ("INI-1", "FRM-3")}
    said = Result("FRM-3", "check_it", Level.WIRE, verdict, "the testee shows nothing of it")
    assert unseen([said], judged, "server") == {NOTHING_CAME: ["INI-1"]}


def test_a_reason_stands_above_what_it_is_the_reason_of():
    out = CleanConsole(file=io.StringIO(), width=80)
    print_unseen(out, {"why not": ["INI-1", "INI-2"], "nowhere": ["SEC-2"]})
    assert out.file.getvalue().splitlines() == [
        *("", "Not seen, and why:"),
        *("   2  why not", "      INI-1 INI-2", "   1  nowhere", "      SEC-2"),
    ]
