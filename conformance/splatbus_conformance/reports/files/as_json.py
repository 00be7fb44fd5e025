"""The report of a run as one object (schema: report.schema.json); all others are made of it."""

import platform
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

from splatbus_schemas.requirements import Requirement
from splatbus_schemas.version import installed_version

from splatbus_conformance.plan import Side
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.thresholds import observed
from splatbus_conformance.reports.triage import start_with
from splatbus_conformance.verdicts import Level, Result, by_requirement, reached, worst

FORMAT = "1"
Report = Mapping[str, Any]
"""What `json_report` gives, or what was read from a file and satisfies the schema."""


def json_report(
    testee: str,
    side: Side,
    sentence: str,
    results: Iterable[Result],
    judged: Mapping[str, Requirement],
    *,
    exit_code: int,
    traffic: Traffic,
    seconds: float,
    least: Level = Level.PASSIVE,
    complaints: Iterable[str] = (),
    deselected: Mapping[str, list[str]] = MappingProxyType({}),
    not_judged: Iterable[str] = (),
    profile: str | None,
    seeds: Sequence[int],
) -> dict[str, Any]:
    """The report as one object, which satisfies report.schema.json.

    Args:
        testee: its command, or what else was judged.
        side: which of the two it is.
        sentence: the verdict.
        results: of all checks and rules.
        judged: the requirements that it could be judged by.
        exit_code: of the command.
        traffic: what crossed the wire, in numbers.
        seconds: how long the run took, or the session that was recorded.
        least: the least assurance at which something counts as observed.
        complaints: what fails the run besides verdicts.
        deselected: by requirement, what the user left out.
        not_judged: what a recording holds that no rule could judge.
        profile: how many cases were asked for; None where no cases were drawn.
        seeds: of the drawn cases.
    """
    results = list(results)
    groups = by_requirement(results)
    return {
        "format": FORMAT,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "testee": testee,
        "side": side,
        "version": traffic.version,
        "summary": sentence,
        "exitCode": exit_code,
        "level": reached(results),
        "observed": len(observed(results, judged, least)),
        "casesDelivered": traffic.delivered,
        "seconds": round(seconds, 3),
        "harnessSeconds": round(traffic.busy_seconds, 3),
        "waitingSeconds": round(traffic.waiting_seconds, 3),
        "profile": profile,
        "seeds": list(seeds),
        "complaints": list(complaints),
        "advice": [*traffic.advice, *filter(None, [start_with(results)])],
        "notJudged": list(not_judged),
        "environment": {
            "harness": installed_version(),
            "python": platform.python_version(),
            "platform": sys.platform,
            "machine": platform.machine(),
            "host": platform.node(),
            "device": traffic.device,
        },
        "latencies": latencies.as_json(traffic.latencies),
        "requirements": [
            {
                "id": requirement.id,
                "level": requirement.level,
                "sentence": requirement.sentence,
                "acceptable": list(requirement.acceptable),
                "verdict": worst(groups.get(requirement.id, [])),
                "deselected": deselected.get(requirement.id, []),
                "results": [_result(each) for each in groups.get(requirement.id, [])],
            }
            for requirement in judged.values()
        ],
        "others": [
            {"requirement": each.requirement, **_result(each)}
            for each in results
            if each.requirement not in judged
        ],
    }


def _result(result: Result) -> dict[str, Any]:
    return {
        "check": result.check,
        "assurance": result.level,
        "verdict": result.verdict,
        "text": result.text,
        "evidence": list(result.evidence),
        "delivered": result.delivered,
        "seconds": round(result.seconds, 4),
        "measurements": [it.as_json() for it in result.measurements],
        "smallest": result.smallest,
        "replay": result.replay,
    }
