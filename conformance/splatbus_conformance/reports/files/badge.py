"""A badge: the JSON that the endpoint badge of shields.io reads."""

import json
from collections.abc import Iterable

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING

CONFORMING, AS_EXPECTED, NOT_CONFORMING, NO_VERDICT = "brightgreen", "yellow", "red", "lightgrey"
WORST_FIRST = (NOT_CONFORMING, NO_VERDICT, AS_EXPECTED, CONFORMING)


def badge(reports: Iterable[Report]) -> str:
    """What a badge says of these reports, as JSON: of several the colour is that of the worst."""
    reports = list(reports)
    sides = len(reports) > 1
    told = [
        f"{report['side']}: {_message(report)}" if sides else _message(report) for report in reports
    ]
    colours = [_colour(report) for report in reports]
    version = max(report["version"] for report in reports)
    return json.dumps(
        {
            "schemaVersion": 1,
            "label": f"SplatBus {version}",
            "message": "; ".join(dict.fromkeys(told)),
            "color": min(colours, key=WORST_FIRST.index),
        }
    )


def _message(report: Report) -> str:
    if _colour(report) == NO_VERDICT:
        return "no verdict"
    observed = f"{report['level']}, {report['observed']} of {len(report['requirements'])}"
    broken = _count(report, "fail") + _count(report, "expected")
    if broken:
        return f"{observed}, {broken} broken"
    return observed if report["exitCode"] == EXIT_CONFORMING else f"{observed}, not conforming"


def _colour(report: Report) -> str:
    if report["exitCode"] == EXIT_CONFORMING:
        return AS_EXPECTED if _count(report, "expected") else CONFORMING
    return NOT_CONFORMING if report["exitCode"] == EXIT_NOT_CONFORMING else NO_VERDICT


def _count(report: Report, verdict: str) -> int:
    return sum(entry["verdict"] == verdict for entry in report["requirements"])
