"""Too little observed is a failure where somebody asked for more."""

from dataclasses import replace

from splatbus_conformance.reports.thresholds import (
    Thresholds,
    missing,
    observed,
    shortfalls,
)
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

JUDGED = {name: requirements("1.1")[name] for name in ("FRM-1", "FRM-2", "FRM-3", "FRM-4")}
MUSTS = [name for name, it in JUDGED.items() if it.level.startswith("MUST")]
RESULTS = [
    Result("FRM-1", "rule", Level.PASSIVE, Verdict.PASS),
    Result("FRM-3", "check", Level.WIRE, Verdict.FAIL),
    Result("FRM-4", "check", Level.WIRE, Verdict.SKIP),
    Result("FRM-2", "check", Level.WIRE, Verdict.ERROR),
]


def test_what_the_testee_could_have_shown_is_named_where_the_machine_was_busy() -> None:
    missed = Result("FRM-4", "check", Level.WIRE, Verdict.SKIP, missed=True)
    found = [*RESULTS, missed, replace(missed, requirement="FRM-1")]
    told = missing(found, JUDGED, 0.13, ", with a load of 9 on 2 processors")
    assert told.startswith("Fewer than usual were observed: FRM-4, of which")
    assert "0.1 s too late, with a load of 9 on 2 processors" in told


def test_what_the_testee_cannot_show_is_not_missed() -> None:
    assert missing(RESULTS, JUDGED, 9.0, "") == ""


def test_skips_and_errors_are_not_observed() -> None:
    assert observed(RESULTS, JUDGED) == {"FRM-1", "FRM-3"}


def test_what_was_seen_at_less_assurance_does_not_count() -> None:
    assert observed(RESULTS, JUDGED, Level.WIRE) == {"FRM-3"}


def test_coverage_is_of_the_musts() -> None:
    share = sum(name in ("FRM-1", "FRM-3") for name in MUSTS) / len(MUSTS)
    assert shortfalls(RESULTS, JUDGED, Thresholds(coverage=share), "1.1") == []
    (sentence,) = shortfalls(RESULTS, JUDGED, Thresholds(coverage=share + 0.01), "1.1")
    assert f"2 of {len(MUSTS)} MUSTs" in sentence


def test_a_level_that_nothing_reached() -> None:
    assert shortfalls(RESULTS, JUDGED, Thresholds(Level.WIRE), "1.1") == []
    assert shortfalls(RESULTS, JUDGED, Thresholds(Level.ADAPTER), "1.1") == [
        "--require-level L2: nothing was observed at L2 or above"
    ]
