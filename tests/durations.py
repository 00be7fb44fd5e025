"""`python -m tests.durations REPORT.json …`: how long checks take, for those who share them out.

Give it reports of the reference pair in both profiles: the client's, beside its adapter and with
`--stand-in-cuda` too, and the server's. Of several that ran a check the quickest counts, for a busy
machine makes any of them slower. A check that none of them ran is forgotten.
"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.results import results

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "conformance" / "splatbus_conformance" / "data" / "durations.json"
SHORT_SECONDS = 0.3
"""Shorter checks fill the gaps in any order."""


def durations(reports: Iterable[Report]) -> dict[str, dict[str, float]]:
    """By profile, the seconds of each check that is not short, the longest first."""
    found: dict[str, dict[str, float]] = {"quick": {}, "full": {}}
    for report in reports:
        of = found[report["profile"]]
        for _, _, _, result in results(report):
            if result["delivered"]:
                name, seconds = result["check"], result["seconds"]
                of[name] = min(of.get(name, seconds), seconds)
    return {
        profile: {
            name: round(seconds, 1)
            for name, seconds in sorted(of.items(), key=lambda it: -it[1])
            if seconds >= SHORT_SECONDS
        }
        for profile, of in found.items()
    }


if __name__ == "__main__":
    given = [json.loads(Path(name).read_text("utf-8")) for name in sys.argv[1:]]
    FILE.write_text(json.dumps(durations(given), indent=1) + "\n", "utf-8")
