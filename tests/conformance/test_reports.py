"""Reports for programs: valid, complete, and not to be broken by what a testee sends."""

from xml.etree import ElementTree

import jsonschema
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.data import read_json
from splatbus_conformance.findings import Traffic
from splatbus_conformance.reports import json_report, junit_report
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

TRAFFIC = Traffic("cmd", "1.1", delivered=3, busy_seconds=0.01, waiting_seconds=1.2)
KNOWN = requirements("1.1")
RESULTS = [
    Result("FRM-1", "rule", Level.PASSIVE, Verdict.PASS, "held", (), 0.1),
    Result("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, "seen", ("line <&>",), 0.2),
    Result("FRM-7", "rule", Level.PASSIVE, Verdict.WARN, "apart"),
    Result("JSN-1", "check_b", Level.WIRE, Verdict.SKIP, "no hello"),
    Result("JSN-2", "check_c", Level.WIRE, Verdict.ERROR, "KeyError: 1"),
]


def test_json_report_satisfies_its_schema_and_names_every_requirement() -> None:
    report = json_report(
        "cmd",
        "sentence",
        RESULTS,
        KNOWN,
        exit_code=1,
        traffic=TRAFFIC,
        seconds=1.5,
        complaints=["too little"],
        deselected={"POS-1": ["rule"]},
        profile="soak",
        seeds=[3, 4],
    )
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(report)
    assert {entry["id"] for entry in report["requirements"]} == set(KNOWN)
    verdicts = {entry["id"]: entry["verdict"] for entry in report["requirements"]}
    assert verdicts["FRM-3"] == "fail"
    assert verdicts["POS-1"] == "skip"


def test_junit_counts_failures_errors_and_skips() -> None:
    suite = ElementTree.fromstring(junit_report("cmd", RESULTS, 1.5))[0]
    counts = {name: suite.get(name) for name in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "5", "failures": "1", "errors": "1", "skipped": "2"}
    failure = suite.find("./testcase/failure")
    assert failure is not None
    assert "line <&>" in (failure.text or "")


def test_junit_fails_on_complaints_and_skips_expected_failures() -> None:
    known = Result("FRM-3", "check_a", Level.WIRE, Verdict.EXPECTED, "seen (expected: issue 17)")
    suite = ElementTree.fromstring(junit_report("cmd", [known], 1.5, ["too little"]))[0]
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
    suite = ElementTree.fromstring(junit_report(text, results, 0.0))[0]
    assert len(suite) == 1
