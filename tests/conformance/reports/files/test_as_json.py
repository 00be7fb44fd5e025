"""The JSON report, which all others are made of, and its schema."""

import json

import pytest
from splatbus_conformance.cli.main import main
from splatbus_conformance.data import read_json
from splatbus_conformance.reports.files.stored import validator

from tests.conformance.reports.stored_reports import KNOWN, brief, changed, full_report, places


def test_it_names_every_requirement_and_what_befell_the_run() -> None:
    report = full_report()
    validator().validate(report)
    validator().validate([report, report])
    verdicts = {entry["id"]: entry["verdict"] for entry in report["requirements"]}
    assert list(verdicts) == list(KNOWN)
    assert (verdicts["FRM-3"], verdicts["POS-1"]) == ("fail", "skip")
    assert (report["observed"], report["level"]) == (5, "L0")
    assert report["others"][0]["check"] == "collection"


def test_its_schema_knows_every_member_and_its_type() -> None:
    report = brief(full_report())
    for at in places(report):
        assert not validator().is_valid(changed(report, at, {})), at
        if isinstance(at[-1], str):
            assert not validator().is_valid(changed(report, at)), at


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == read_json("report.schema.json")
