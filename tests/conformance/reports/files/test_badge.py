"""The badge: what it says, and how it is coloured."""

import json
from typing import Any

import pytest
from splatbus_conformance.reports.files.badge import badge
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.conformance.reports.stored_reports import KNOWN, report_of

MET = Result("FRM-1", "check_a", Level.ADAPTER, Verdict.PASS)
BROKEN = Result("FRM-3", "check_b", Level.WIRE, Verdict.FAIL, "seen")
KNOWN_TO_BE = Result("FRM-4", "check_c", Level.WIRE, Verdict.EXPECTED, "seen")
ALL = len(KNOWN)


def told(*reports: dict[str, Any]) -> tuple[str, str]:
    made = json.loads(badge(reports))
    assert set(made) == {"schemaVersion", "label", "message", "color"}
    assert (made["schemaVersion"], made["label"]) == (1, "SplatBus 1.1")
    return made["message"], made["color"]


@pytest.mark.parametrize(
    ("results", "exit_code", "message", "colour"),
    [
        ([MET], 0, f"L2, 1 of {ALL}", "brightgreen"),
        ([MET, BROKEN], 1, f"L2, 2 of {ALL}, 1 broken", "red"),
        ([MET, KNOWN_TO_BE], 0, f"L2, 2 of {ALL}, 1 broken", "yellow"),
        ([MET], 1, f"L2, 1 of {ALL}, not conforming", "red"),
        ([], 3, "no verdict", "lightgrey"),
    ],
)
def test_a_badge_says_what_the_report_says(
    results: list[Result], exit_code: int, message: str, colour: str
) -> None:
    assert told(report_of(*results, exitCode=exit_code)) == (message, colour)


def test_of_two_peers_both_are_told_and_the_worse_colours_it() -> None:
    client = report_of(MET, exitCode=0)
    server = report_of(BROKEN, side="server", version="1.0", exitCode=1)
    message, colour = told(client, server)
    assert message == f"client: L2, 1 of {ALL}; server: L0, 1 of {ALL}, 1 broken"
    assert colour == "red"
    assert told(client, report_of(exitCode=3))[1] == "lightgrey"
