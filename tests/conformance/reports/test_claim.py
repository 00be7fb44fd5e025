"""What may be claimed of a program after a run."""

from dataclasses import replace
from typing import Any

import pytest
from splatbus_conformance.reports.claim import claim
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements, status
from splatbus_schemas.version import installed_version

MET = Result("FRM-3", "check_a", Level.WIRE, Verdict.PASS, "it closed")
ADVICE = Result("FRM-7", "rule", Level.PASSIVE, Verdict.WARN, "apart")
WHOLE = RunReport(
    "cmd",
    "client",
    "conforming at L1",
    [MET, ADVICE],
    requirements("1.1"),
    0,
    Traffic("cmd", "1.1", delivered=3),
    1.5,
    profile="full",
    seeds=[7],
)


def test_a_whole_run_bears_out_a_claim_in_the_form_of_the_text() -> None:
    assert claim(WHOLE) == (
        f"conforms to SplatBus 1.1 {status('1.1')} as a client, judged by splatbus-conformance "
        f"{installed_version()}, profile full, seed 7, at L1"
    )


@pytest.mark.parametrize("verdict", [Verdict.FAIL, Verdict.EXPECTED, Verdict.ERROR])
def test_what_was_broken_keeps_it_from_being_made(verdict: Verdict) -> None:
    broken = Result("JSN-4", "check_b", Level.WIRE, verdict, "seen")
    assert claim(replace(WHOLE, results=[MET, broken])) is None


@pytest.mark.parametrize(
    "less",
    [{"status": 3}, {"status": 1}, {"profile": None}, {"deselected": {"FRM-3": ["check_a"]}}],
    ids=str,
)
def test_part_of_a_run_bears_out_none(less: dict[str, Any]) -> None:
    assert claim(replace(WHOLE, **less)) is None
