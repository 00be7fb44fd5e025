"""Reports for tests: of every verdict, of complaints, of nothing at all."""

from collections.abc import Iterable
from typing import Any

from splatbus_conformance.measurements import Measurement
from splatbus_conformance.reports.files.as_json import json_report
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

KNOWN = requirements("1.1")
TRAFFIC = Traffic("cmd", "1.1", delivered=3, busy_seconds=0.01, waiting_seconds=1.2)
FAR_OFF = Measurement("axis", float("inf"), 1.0, "ulp", "zeros", 3, 1)
EVERY_VERDICT = (
    Result("FRM-1", "rule", Level.PASSIVE, Verdict.PASS, "held", (), 0.1, (FAR_OFF,)),
    Result(
        *("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, "seen", ("line <&>",), 0.2),
        smallest="one case",
        replay="splatbus-conformance replay a.json --launch cmd",
    ),
    Result("FRM-7", "rule", Level.PASSIVE, Verdict.WARN, "apart"),
    Result("JSN-1", "check_b", Level.WIRE, Verdict.SKIP, "no hello"),
    Result("JSN-2", "check_c", Level.ADAPTER, Verdict.ERROR, "KeyError: 1"),
    Result("JSN-4", "check_d", Level.WIRE, Verdict.EXPECTED, "seen (expected: issue 17)"),
    Result("", "collection", Level.WIRE, Verdict.ERROR, "no such file"),
)
HOSTILE = (
    "]]><failure/></failure></testcase><!-- &lt; \x00\x1b[31m \udfff\ud800 \ufffe",
    "</testcase>\"'<script>alert(1)</script>",
    "```\n# heading\n</details><details><summary>`` ` ```````",
    "| a \\| b |\r\n|---|\u2028\u202e\x85 ![x](y) &amp; ~~~\n    indented",
    "",
    " \t\n",
)


def failure(text: str) -> Result:
    """A failure in which everything that can come from a testee is this text."""
    return Result(
        *("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, text, (text, text), 0.2),
        smallest=text,
        replay=f"splatbus-conformance replay {text}",
    )


def report_of(*results: Result, complaints: Iterable[str] = (), **changed: Any) -> dict[str, Any]:
    """The report of a run with these results."""
    made = json_report(
        RunReport(
            "cmd",
            "client",
            "not conforming: FRM-3 broken: 3 of 6 requirements observed",
            results,
            KNOWN,
            1,
            TRAFFIC,
            1.5,
            complaints=list(complaints),
            deselected={"POS-1": ["rule"]},
            profile="soak",
            seeds=[3, 4],
        )
    )
    return made | changed
