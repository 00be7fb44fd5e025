"""A badge: the JSON that the endpoint badge of shields.io reads."""

import json
from collections import Counter
from collections.abc import Iterable

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING

CONFORMING, AS_EXPECTED, NOT_CONFORMING, NO_VERDICT = "brightgreen", "yellow", "red", "lightgrey"
WORST_FIRST = (NOT_CONFORMING, NO_VERDICT, AS_EXPECTED, CONFORMING)


def badge(reports: Iterable[Report]) -> str:
    """What a badge says of these reports, as JSON: of several the colour is that of the worst."""
    reports = list(reports)
    told = [(report, *_told(report)) for report in reports]
    messages = [message for _, message, _ in told]
    if len(reports) > 1:
        messages = [f"{report['side']}: {message}" for report, message, _ in told]
    return json.dumps(
        {
            "schemaVersion": 1,
            "label": f"SplatBus {max(report['version'] for report in reports)}",
            "message": "; ".join(dict.fromkeys(messages)),
            "color": min((colour for *_, colour in told), key=WORST_FIRST.index),
        }
    )


def _told(report: Report) -> tuple[str, str]:
    """What is said of one report, and its colour."""
    status, count = report["exitCode"], Counter(it["verdict"] for it in report["requirements"])
    if status not in (EXIT_CONFORMING, EXIT_NOT_CONFORMING):
        return "no verdict", NO_VERDICT
    message = f"{report['level']}, {report['observed']} of {len(report['requirements'])}"
    if broken := count["fail"] + count["expected"]:
        message += f", {broken} broken"
    elif status:
        message += ", not conforming"
    if status:
        return message, NOT_CONFORMING
    return message, AS_EXPECTED if count["expected"] else CONFORMING
