"""JUnit XML: what CI systems accept, whatever a testee sends."""

from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree
from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.junit import junit_report
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.conformance.reports.stored_reports import EVERY_VERDICT, HOSTILE, failure, report_of

DATA = Path(__file__).parent / "data"


@cache
def schemas() -> tuple[etree.XMLSchema, etree.RelaxNG]:
    """Of Jenkins and of Ant (data/README.md)."""
    jenkins = etree.XMLSchema(etree.parse(DATA / "junit-10.xsd"))
    return jenkins, etree.RelaxNG(etree.parse(DATA / "ant.rng"))


def read(*reports: Report) -> etree._Element:
    """The root of the XML, which satisfies both schemas."""
    root = etree.fromstring(junit_report(reports))
    for schema in schemas():
        schema.assertValid(root)
    return root


def counts(suite: etree._Element) -> dict[str, int]:
    return {name: int(suite.get(name)) for name in ("tests", "failures", "errors", "skipped")}


def test_every_verdict_is_a_test_case_and_is_counted() -> None:
    (suite,) = read(report_of(*EVERY_VERDICT))
    assert counts(suite) == {"tests": 7, "failures": 1, "errors": 2, "skipped": 3}
    for tag, count in (("testcase", 7), ("*/failure", 1), ("*/error", 2), ("*/skipped", 3)):
        assert len(suite.findall(tag)) == count
    assert suite.find("testcase").get("classname") == "splatbus.client.FRM-1"


def test_a_failure_tells_the_sentence_what_came_and_how_to_see_it_again() -> None:
    (suite,) = read(report_of(*EVERY_VERDICT))
    broken = suite.find("*/failure")
    assert broken.get("message") == "seen"
    for line in (
        "the standard: A receiver MUST close a connection",
        "acceptable: closes",
        "seen: seen",
        "line <&>",
        "to see it: splatbus-conformance replay a.json --launch cmd",
    ):
        assert line in broken.text


def test_complaints_fail_and_expected_failures_are_skipped() -> None:
    known = Result("FRM-3", "check_a", Level.WIRE, Verdict.EXPECTED, "seen (expected: issue 17)")
    (suite,) = read(report_of(known, complaints=["too little"]))
    assert counts(suite) == {"tests": 2, "failures": 1, "errors": 0, "skipped": 1}
    assert suite.find("*/skipped").get("message") == "expected failure: seen (expected: issue 17)"
    assert suite.find("*/failure").get("message") == "too little"


def test_an_empty_run_is_a_suite_without_cases() -> None:
    (suite,) = read(report_of())
    assert counts(suite) == {"tests": 0, "failures": 0, "errors": 0, "skipped": 0}


def test_a_suite_says_when_where_and_of_what() -> None:
    report = report_of(*EVERY_VERDICT)
    (suite,) = read(report)
    assert f"{suite.get('timestamp')}+00:00" == report["made"]
    assert suite.get("hostname") == report["environment"]["host"]
    told = {each.get("name"): each.get("value") for each in suite.find("properties")}
    assert told["summary"] == report["summary"]
    assert told["seeds"] == "3,4"
    advised = read(report | {"advice": ["Start with FRM-2"], "notJudged": ["3 bytes"]})[0]
    assert advised.find("system-out").text == f"{report['summary']}\nStart with FRM-2\n3 bytes"
    nameless = report | {"environment": report["environment"] | {"host": " "}}
    assert read(nameless)[0].get("hostname") == "localhost"


def test_several_reports_are_several_numbered_suites() -> None:
    root = read(report_of(*EVERY_VERDICT), report_of(side="server", profile=None, seeds=[]))
    assert [(each.get("id"), each.get("package")) for each in root] == [
        ("0", "splatbus.client"),
        ("1", "splatbus.server"),
    ]
    assert "None" not in [each.get("value") for each in root.iter("property")]


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_is_shown_and_breaks_nothing(text: str) -> None:
    report = report_of(failure(text), complaints=[text], testee=text)
    (suite,) = read(report)
    assert counts(suite) == {"tests": 2, "failures": 2, "errors": 0, "skipped": 0}
    assert len(suite.findall("testcase")) == 2


@given(st.text())
def test_no_text_of_a_testee_breaks_the_xml(text: str) -> None:
    (suite,) = read(report_of(failure(text), testee=text))
    assert len(suite.findall("testcase")) == 1
