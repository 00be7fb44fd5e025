"""What is made of a report for CI systems, job summaries and badges: it says what the report says,
and nothing that a testee sends breaks out of it.
"""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from lxml import etree
from markdown_it import MarkdownIt
from splatbus_conformance.reports.files.badge import badge
from splatbus_conformance.reports.files.junit import junit_report
from splatbus_conformance.reports.files.markdown import markdown_report
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.conformance.reports.stored_reports import (
    HOSTILE,
    KNOWN,
    full_report,
    of_a_testee,
    report_of,
)

ALL = len(KNOWN)
JENKINS = etree.XMLSchema(etree.parse(Path(__file__).parent / "data" / "junit-10.xsd"))
MARKS = "`~|<>\\\n\r\t #-+*_&;!:/@.1[](){}=\"'x"
WITHOUT = {"profile": None, "seeds": [], "latencies": []}


def suites(*reports: dict[str, Any]) -> etree._Element:
    """The root of JUnit XML, which satisfies its schema, with counts that are true."""
    root = etree.fromstring(junit_report(reports))
    JENKINS.assertValid(root)
    for suite in root:
        counts = [int(suite.get(name)) for name in ("tests", "failures", "errors", "skipped")]
        tags = ("testcase", "*/failure", "*/error", "*/skipped")
        assert counts == [len(suite.findall(tag)) for tag in tags]
    return root


def skeleton(text: str) -> list[object]:
    """What Markdown is made of as GitHub reads it, without what code holds."""
    return [
        (
            token.type,
            token.content if token.type == "html_block" else token.markup[:3],
            [child.type for child in token.children or ()],
        )
        for token in MarkdownIt("commonmark").enable("table").parse(text)
    ]


def test_junit_has_a_case_for_each_result_and_complaint() -> None:
    report = full_report()
    (suite,) = suites(report)
    assert [suite.get(name) for name in ("tests", "failures", "errors")] == ["9", "3", "2"]
    assert f"{suite.get('timestamp')}+00:00" == report["made"]
    assert suite.get("hostname") == report["environment"]["host"]
    told = {each.get("name"): each.get("value") for each in suite.find("properties")}
    assert (told["summary"], told["seeds"]) == (report["summary"], "3,4")
    (broken,) = suite.xpath("testcase[@classname='splatbus.client.FRM-3']/failure")
    assert (broken.get("type"), broken.get("message")) == ("hangs", "seen")
    for line in (
        "the standard: A receiver MUST close a connection",
        "acceptable: closes",
        "seen: seen",
        "line <&>",
        "smallest: one case",
        "to see it: splatbus-conformance replay a.json --launch cmd",
    ):
        assert line in broken.text
    assert suite.xpath("*/skipped/@message") == [
        *("warning: apart", "no hello", "expected failure: seen (expected: issue 17)"),
    ]
    assert suite.xpath("*/failure[@type='complaint']/@message") == ["too little was observed"]
    assert [it.get("name") for it in suite if it.get("classname") == "splatbus.client.run"] == [
        *("run collection (L1)", "too little was observed"),
    ]
    said = (report["summary"], *report["advice"], *report["notJudged"])
    assert suite.find("system-out").text == "\n".join(said)


def test_a_summary_says_the_verdict_the_counts_and_each_failure() -> None:
    made = markdown_report([full_report()])
    count = Counter(it["verdict"] for it in full_report()["requirements"])
    lines = (
        "## SplatBus conformance: client `cmd`",
        "**not conforming: FRM\\-3 broken: 3 of 6 requirements observed**",
        "| broken | 2 |",
        f"| not observed | {count['skip']} |",
        "profile soak; seed 3, 4; 3 cases; 1\\.5 s",
        "- **failed:** too little was observed",
        "Start with FRM\\-3",
        "### broken: FRM-3, rule (L0)",
        "> A receiver MUST close a connection",
        "Acceptable: closes",
        "Seen: `seen`",
        "line <&>",
        "Smallest: `one case`",
        "splatbus-conformance replay a.json --launch cmd",
        "### broken: POS-2, b (L1)",
        "### no verdict: JSN-2, c (L2)",
        "<details><summary>advice not followed: FRM-7, rule (L0)</summary>",
        "<details><summary>broken, as expected: JSN-4, d (L1)</summary>",
        f"{count['skip']} requirements were not observed",
        "- JSN-1: `no hello`",
        "- POS-1: `left out by --select or --deselect`",
        "- `msg #1: 3 bytes`",
    )
    assert [line for line in lines if line not in made] == []
    assert made.index("broken: FRM-3") < made.index("broken: POS-2") < made.index("<details>")
    assert "### no verdict: the run, collection (L1)" in made


def test_what_a_report_lacks_is_not_told() -> None:
    server = report_of(side="server", **WITHOUT)
    (suite,) = suites(server)
    assert "None" not in suite.xpath("*/property/@value")
    assert (len(suite.findall("testcase")), "seed" in markdown_report([server])) == (0, False)


@example("`")
@example("```\n# heading\n````")
@example("\\`")
@given(st.sampled_from(HOSTILE) | st.text(MARKS) | st.text())
def test_no_text_of_a_testee_breaks_out(text: str) -> None:
    report = of_a_testee(f"x{text}x")
    (suite,) = suites(report)
    assert len(suite.findall("testcase")) == 4
    made = markdown_report([report])
    made.encode()
    assert skeleton(made) == skeleton(markdown_report([of_a_testee("harmless")]))


def test_what_there_is_no_room_for_is_counted() -> None:
    long = Result("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, "€" * 9999, ("`€" * 9999,) * 9)
    report = report_of(*[long] * 400)
    for most in (1 << 20, 100_000):
        made = markdown_report([report], most)
        assert most / 2 < len(made.encode()) <= most
        shown = made.count("### broken")
        assert f"Too long for a summary: {400 - shown + 1} more parts" in made
        assert skeleton(made)[-1][0] == "paragraph_close"  # type: ignore[index]
    assert "Too long" not in markdown_report([full_report()] * 9)


MET = Result("FRM-1", "check_a", Level.ADAPTER, Verdict.PASS)
BROKEN = Result("FRM-3", "check_b", Level.WIRE, Verdict.FAIL, "seen")
KNOWN_TO_BE = Result("FRM-4", "check_c", Level.WIRE, Verdict.EXPECTED, "seen")
SERVER = {"side": "server", "version": "1.0"}


@pytest.mark.parametrize(
    ("reports", "message", "colour"),
    [
        ([report_of(MET, exitCode=0)], f"L2, 1 of {ALL}", "brightgreen"),
        ([report_of(MET, BROKEN)], f"L2, 2 of {ALL}, 1 broken", "red"),
        ([report_of(MET, KNOWN_TO_BE, exitCode=0)], f"L2, 2 of {ALL}, 1 broken", "yellow"),
        ([report_of(MET)], f"L2, 1 of {ALL}, not conforming", "red"),
        ([report_of(exitCode=3)], "no verdict", "lightgrey"),
        (
            [report_of(MET, exitCode=0), report_of(BROKEN, **SERVER)],
            f"client: L2, 1 of {ALL}; server: L0, 1 of {ALL}, 1 broken",
            "red",
        ),
    ],
)
def test_a_badge_says_what_the_reports_say_and_the_worst_colours_it(
    reports: list[dict[str, Any]], message: str, colour: str
) -> None:
    told = {"message": message, "color": colour}
    assert json.loads(badge(reports)) == {"schemaVersion": 1, "label": "SplatBus 1.1", **told}
