"""A report in which everything occurs that can, and pieces to make others of."""

import copy
import json
from collections.abc import Iterator
from typing import Any

from splatbus_conformance.measurements import Measurement
from splatbus_conformance.reports.files.as_json import json_report
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.latencies import Histogram
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

KNOWN = requirements("1.1")
TIMED = Histogram()
for seconds in (0.0004, 0.0005, 0.02):
    TIMED.take(seconds)
MEASURED = (
    Measurement("angle", 1e-9, None, "rad", "a", 4, 0),
    Measurement("colour", 0.5, 3.0, "ULP", "b", 5, 0),
    Measurement("position", 2.0, 0.0, "ULP", "c", 6, 2),
    Measurement("depth", float("inf"), 1.0, "ULP", "d", 7, 1),
    Measurement("quaternion", 0.0, 8.0, "u", "e", 8, 0),
)
EVERY_VERDICT = (
    Result("POS-2", "check_b", Level.WIRE, Verdict.FAIL, "later", code="off"),
    Result("FRM-1", "rule", Level.PASSIVE, Verdict.PASS, "held", (), 0.1, MEASURED),
    Result(
        *("FRM-3", "rule", Level.PASSIVE, Verdict.FAIL, "seen", ("line <&>", "> 7b"), 0.2),
        smallest="one case",
        pictures=(("what came", "AAAA+/=="),),
        replay="splatbus-conformance replay a.json --launch cmd",
        code="hangs",
    ),
    Result("FRM-7", "rule", Level.PASSIVE, Verdict.WARN, "apart"),
    Result("JSN-1", "check_b", Level.WIRE, Verdict.SKIP, "no hello"),
    Result("JSN-2", "check_c", Level.ADAPTER, Verdict.ERROR, "KeyError: 1"),
    Result("JSN-4", "check_d", Level.WIRE, Verdict.EXPECTED, "seen (expected: issue 17)"),
    Result("", "collection", Level.WIRE, Verdict.ERROR, "no such file"),
)
HOSTILE = (
    "]]><failure/></failure></testcase><!-- &lt; \x00\x1b[31m \udfff\ud800 \ufffe",
    "</testcase>\"'</style></title><script>alert(1)</script><img src=x onerror=y>",
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
        pictures=((text, "AAAA"),),
    )


def report_of(*results: Result, **changed: Any) -> dict[str, Any]:
    """The report of a run with these results, as it is read from a file."""
    made = RunReport(
        "cmd",
        "client",
        "not conforming: FRM-3 broken: 3 of 6 requirements observed",
        results,
        KNOWN,
        1,
        Traffic("cmd", "1.1", delivered=3, latencies={"ping → pong": TIMED}),
        1.5,
        deselected={"POS-1": ["rule"]},
        profile="soak",
        seeds=[3, 4],
    )
    return json.loads(json.dumps(json_report(made))) | changed  # type: ignore[no-any-return]


def full_report() -> dict[str, Any]:
    return report_of(
        *EVERY_VERDICT,
        complaints=["too little was observed"],
        notJudged=["msg #1: 3 bytes"],
        advice=["Start with FRM-3: it is the root."],
    )


def brief(report: dict[str, Any]) -> dict[str, Any]:
    """The report without the requirements of which it says nothing."""
    told = [it for it in report["requirements"] if it["results"] or it["deselected"]]
    return report | {"requirements": told}


def of_a_testee(text: str) -> dict[str, Any]:
    """A report in which everything that can come from a testee is this text."""
    warning = Result("FRM-7", "rule", Level.PASSIVE, Verdict.WARN, text, (text,))
    skip = Result("JSN-1", "check_b", Level.WIRE, Verdict.SKIP, text)
    made = report_of(failure(text), warning, skip, testee=text, notJudged=[text])
    quoted = {"complaints": [f"a {text} b"], "advice": [f"a {text} b"], "summary": f"a {text} b"}
    timed = [it | {"what": text} for it in made["latencies"]]
    return brief(made | quoted | {"latencies": timed})


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where something stands in a document; of lists the first alone."""
    if at:
        yield at
    inside = value.items() if isinstance(value, dict) else ()
    for name, each in enumerate(value[:1]) if isinstance(value, list) else inside:
        yield from places(each, (*at, name))


def changed(value: Any, at: tuple[Any, ...], new: Any = ...) -> Any:
    """A copy with something else at a place; with nothing there, if that is not given."""
    made = copy.deepcopy(value)
    inner = made
    for name in at[:-1]:
        inner = inner[name]
    if new is ...:
        del inner[at[-1]]
    else:
        inner[at[-1]] = new
    return made
