"""Too little observed is a failure where somebody asked for more."""

from dataclasses import replace

import pytest
from splatbus_conformance.reports.thresholds import Thresholds, missing, observed, shortfalls
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

JUDGED = {name: requirements("1.1")[name] for name in ("FRM-1", "FRM-2", "FRM-3", "FRM-4")}
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
    assert told.startswith("Not observed, though the testee can show them: FRM-4. The")
    assert "0.1 s late, with a load of 9 on 2 processors" in told
    assert missing(RESULTS, JUDGED, 9.0, "") == "", "what it cannot show is not missed"


@pytest.mark.parametrize(
    ("demands", "told"),
    [
        (Thresholds(coverage=0.5), ""),
        (Thresholds(coverage=0.51), "--require-coverage 51%: 2 of 4 MUSTs were observed, which is"),
        (Thresholds(Level.WIRE, 0.26), "26%: 1 of 4 MUSTs were observed at L1 or above, which is"),
        (Thresholds(Level.WIRE), ""),
        (Thresholds(Level.ADAPTER), "--require-level L2: nothing was observed at L2 or above"),
        (Thresholds(version="1.1"), "--require-version 1.1: the testee speaks only 1.0"),
    ],
)
def test_each_demand_that_is_not_met_is_told(demands: Thresholds, told: str) -> None:
    sentences = shortfalls(RESULTS, JUDGED, demands, "1.0")
    assert len(sentences) == bool(told)
    assert told in "".join(sentences)
    assert observed(RESULTS, JUDGED) == {"FRM-1", "FRM-3"}, "skips and errors are no observation"
