"""Verdicts, exit codes, and what may be claimed after a run."""

from dataclasses import replace
from typing import Any

import pytest
from splatbus_conformance.measurements import Measurements
from splatbus_conformance.reports.claim import claim
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.verdicts import Level, Result, Verdict, exit_code, failing, worst
from splatbus_schemas.requirements import requirements
from splatbus_schemas.version import installed_version


def result(verdict: str) -> Result:
    return Result("FRM-1", "check", Level.WIRE, Verdict(verdict))


@pytest.mark.parametrize(
    ("verdicts", "expected", "codes"),
    [
        (["pass", "fail", "harness-error"], "fail", (1, 1)),
        (["pass", "harness-error", "warn"], "harness-error", (3, 1)),
        (["pass", "warn"], "warn", (0, 1)),
        (["pass", "expected"], "expected", (0, 0)),
        (["skip", "pass"], "pass", (0, 0)),
        (["skip"], "skip", (3, 3)),
        ([], "skip", (3, 3)),
    ],
)
def test_the_worst_decides_and_a_pass_outweighs_a_skip(
    verdicts: list[str], expected: str, codes: tuple[int, int]
) -> None:
    assert worst(map(result, verdicts)) == expected
    named = {f"FRM-{i}": Verdict(each) for i, each in enumerate(verdicts)}
    assert (exit_code(named), exit_code(named, strict=True)) == codes


def test_a_must_fails_and_a_should_warns() -> None:
    assert failing("MUST NOT") is Verdict.FAIL
    assert failing("SHOULD") is Verdict.WARN


WHOLE = RunReport(
    *("cmd", "client", "conforming at L1", [result("pass"), result("warn")], requirements("1.1")),
    *(0, Traffic("cmd", "1.1"), 1.5),
    profile="full",
    seeds=[7],
)


@pytest.mark.parametrize(
    "less",
    [
        *(
            {"results": [*WHOLE.results, result(it)]}
            for it in ("fail", "expected", "harness-error")
        ),
        *(
            {"status": 3},
            {"profile": None},
            {"deselected": {"FRM-3": ["check_a"]}},
            {"cut": "time"},
        ),
    ],
    ids=str,
)
def test_a_whole_run_in_which_nothing_broke_bears_out_a_claim(less: dict[str, Any]) -> None:
    assert claim(WHOLE) == (
        f"conforms to SplatBus 1.1 as a client, judged by splatbus-conformance "
        f"{installed_version()}, profile full, seed 7, at L1"
    )
    assert claim(replace(WHOLE, **less)) is None


def test_the_worst_error_of_a_quantity_is_kept_with_its_input() -> None:
    measurements = Measurements()
    for error, case in ((0.5, "a"), (3.0, "b"), (2.5, "c"), (2.0, "d"), (1.0, "e")):
        measurements.add("colour", error, 2.0, "ULP", case)
    measurements.add("angle", 1e-9, None, "rad", "a")
    measurements.add("position", 0.0, 0.0, "ULP", "a")
    colour, angle, position = measurements
    assert str(colour) == "colour: worst 3 ULP of 2 in 5 cases at b"
    assert (colour.beyond, angle.worst, angle.beyond) == (2, 1e-9, 0)
    assert str(position) == "position: worst 0 ULP of 0 in 1 cases"
    assert measurements.beyond() == [colour], "only what has a budget can pass it"
    assert measurements.newest() == {"colour": 3.0, "position": 0.0}


@pytest.mark.parametrize("error", [float("inf"), float("nan")])
def test_an_error_that_is_no_number_is_beyond_every_budget(error: float) -> None:
    measurements = Measurements()
    measurements.add("colour", error, 2.0, "ULP", "a")
    (found,) = measurements.beyond()
    assert found.as_json()["worst"] is None
