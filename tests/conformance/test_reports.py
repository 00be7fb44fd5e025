"""Reports for programs: valid, complete, and not to be broken by what a testee sends."""

from xml.etree import ElementTree

import jsonschema
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.data import read_json
from splatbus_conformance.reports.junit import junit_report
from splatbus_conformance.verdicts import Level, Result, Verdict

from tests.conformance.reporting import EVERY_VERDICT, KNOWN, report_of


def test_json_report_satisfies_its_schema_and_names_every_requirement() -> None:
    report = report_of(*EVERY_VERDICT, complaints=["too little"])
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(report)
    assert {entry["id"] for entry in report["requirements"]} == set(KNOWN)
    verdicts = {entry["id"]: entry["verdict"] for entry in report["requirements"]}
    assert verdicts["FRM-3"] == "fail"
    assert verdicts["POS-1"] == "skip"


def test_junit_counts_failures_errors_and_skips() -> None:
    suite = ElementTree.fromstring(junit_report([report_of(*EVERY_VERDICT)]))[0]
    counts = {name: suite.get(name) for name in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "7", "failures": "1", "errors": "2", "skipped": "3"}
    failure = suite.find("./testcase/failure")
    assert failure is not None
    assert "line <&>" in (failure.text or "")


def test_junit_fails_on_complaints_and_skips_expected_failures() -> None:
    known = Result("FRM-3", "check_a", Level.WIRE, Verdict.EXPECTED, "seen (expected: issue 17)")
    suite = ElementTree.fromstring(junit_report([report_of(known, complaints=["too little"])]))[0]
    counts = {name: suite.get(name) for name in ("tests", "failures", "skipped")}
    assert counts == {"tests": "2", "failures": "1", "skipped": "1"}
    skipped, failure = suite.find("./testcase/skipped"), suite.find("./testcase/failure")
    assert skipped is not None
    assert failure is not None
    assert skipped.get("message") == "expected failure: seen (expected: issue 17)"
    assert failure.get("message") == "too little"


@given(st.text())
def test_no_text_of_a_testee_breaks_the_xml(text: str) -> None:
    results = [Result("FRM-3", "check", Level.WIRE, Verdict.FAIL, text, (text,))]
    suite = ElementTree.fromstring(junit_report([report_of(*results, testee=text)]))[0]
    assert len(suite.findall("testcase")) == 1
