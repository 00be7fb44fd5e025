"""The report of a run as one object (schema: report.schema.json); all others are made of it."""

import platform
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from splatbus_schemas.version import installed_version

from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.claim import claim
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.reports.thresholds import observed
from splatbus_conformance.reports.triage import start_with
from splatbus_conformance.verdicts import Result, by_requirement, reached, worst
from splatbus_conformance.wire.secrets import hidden_in

FORMAT = "1"
Report = Mapping[str, Any]
"""What `json_report` gives, or what was read from a file and satisfies the schema."""


def json_report(report: RunReport) -> dict[str, Any]:
    """The report as one object, which satisfies report.schema.json; no token is in it."""
    traffic, groups = report.traffic, by_requirement(report.results)
    document = {
        "format": FORMAT,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "testee": report.testee,
        "side": report.side,
        "version": traffic.version,
        "summary": report.sentence,
        "claim": claim(report),
        "exitCode": report.status,
        "level": reached(report.results),
        "observed": len(observed(report.results, report.judged, report.least)),
        "casesDelivered": traffic.delivered,
        "seconds": round(report.seconds, 3),
        "harnessSeconds": round(traffic.busy_seconds, 3),
        "waitingSeconds": round(traffic.waiting_seconds, 3),
        "profile": report.profile,
        "seeds": list(report.seeds),
        "complaints": list(report.complaints),
        "advice": [*traffic.advice, *filter(None, [start_with(report.results)])],
        "notJudged": list(report.not_judged),
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
                "deselected": report.deselected.get(requirement.id, []),
                "results": [_result(each) for each in groups.get(requirement.id, [])],
            }
            for requirement in report.judged.values()
        ],
        "others": [
            {"requirement": each.requirement, **_result(each)}
            for each in report.results
            if each.requirement not in report.judged
        ],
    }
    return {name: hidden_in(each) for name, each in document.items()}


def _result(result: Result) -> dict[str, Any]:
    return {
        "check": result.check,
        "assurance": result.level,
        "verdict": result.verdict,
        "code": result.code,
        "text": result.text,
        "evidence": list(result.evidence),
        "delivered": result.delivered,
        "seconds": round(result.seconds, 4),
        "measurements": [it.as_json() for it in result.measurements],
        "smallest": result.smallest,
        "replay": result.replay,
        "pictures": [{"title": title, "png": png} for title, png in result.pictures],
    }
