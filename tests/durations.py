"""`python -m tests.durations REPORT.json …`: how long checks take, for those who share them out.

Give it reports of the reference pair on an idle machine, in both profiles: the client's, beside
its adapter and with `--stand-in-cuda` too, and the server's. A check that none
of them has is forgotten.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from splatbus_conformance.reports.as_json import Report
from splatbus_conformance.reports.results import results

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "conformance" / "splatbus_conformance" / "durations.json"
SHORT_SECONDS = 0.3
"""Shorter checks fill the gaps in any order."""


def durations(reports: Iterable[Report]) -> dict[str, dict[str, float]]:
    """By profile, the seconds of each check that is not short, the longest first."""
    found: dict[str, dict[str, float]] = {"quick": defaultdict(float), "full": defaultdict(float)}
    for report in reports:
        of = found[report["profile"]]
        for told in results(report):
            of[told.result["check"]] = max(of[told.result["check"]], told.result["seconds"])
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
