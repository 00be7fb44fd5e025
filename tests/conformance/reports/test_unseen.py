"""What a run has come to no word on: every requirement has a verdict, a skip or a reason here."""

import pytest
from splatbus_conformance.checks.registry import exclusions, judges
from splatbus_conformance.plan import SIDES
from splatbus_conformance.reports.unseen import NOT_RUN, NOTHING_CAME, NOWHERE, unseen
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements


@pytest.mark.parametrize("side", SIDES)
def test_each_requirement_that_nothing_was_said_of_has_one_reason(side: str) -> None:
    judged = {name: it for name, it in requirements("1.1").items() if side in it.binds}
    said = Result("INI-1", "check_it", Level.WIRE, Verdict.SKIP, "the testee shows nothing of it")
    found = unseen([said], judged, side)
    assert sorted(name for names in found.values() for name in names) == sorted(
        {*judged} - {"INI-1"}
    )
    for reason, names in found.items():
        for name in names:
            levels = {judge.level for judge in judges(side).get(name, [])}
            assert reason.startswith(NOWHERE) is (name in exclusions(side))
            assert reason.startswith(NOWHERE) or (reason == NOTHING_CAME) is (levels == {"L0"})
    assert NOT_RUN in found
