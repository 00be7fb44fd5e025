"""The JSON report and its schema: everything in it is described, and what is damaged fails."""

import copy
import json
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from splatbus_conformance.cli import commands
from splatbus_conformance.cli.main import main
from splatbus_conformance.data import read_json
from splatbus_conformance.plan import Plan
from splatbus_conformance.reports.files.stored import validator
from splatbus_conformance.reports.latencies import Histogram
from splatbus_conformance.run.options import RunOptions

from tests.conformance.harness import GOOD, broken, run, said
from tests.conformance.reports.stored_reports import (
    EVERY_VERDICT,
    HOSTILE,
    KNOWN,
    TRAFFIC,
    failure,
    report_of,
)

RECORDINGS = Path(__file__).parents[3] / "data" / "recordings"
SCHEMA = read_json("report.schema.json")
RESULT = "#/$defs/result"
Place = tuple[str | int, ...]


def parts(schema: Any) -> Iterator[dict[str, Any]]:
    """The schema and all schemas in it."""
    if isinstance(schema, dict):
        yield schema
    for each in schema.values() if isinstance(schema, dict) else schema:
        if isinstance(each, dict | list):
            yield from parts(each)


@cache
def closed() -> Any:
    """A validator that takes no member which the schema does not know.

    The schema itself is open, so that readers of today can read what is written tomorrow.
    """
    schema = copy.deepcopy(SCHEMA)
    for part in parts(schema):
        if part is not schema["$defs"]["result"] and (
            "properties" in part or part.get("$ref") == RESULT
        ):
            part["unevaluatedProperties"] = False
    return jsonschema.Draft202012Validator(schema)


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    """A report in which nothing that can be filled is empty, of few requirements."""
    TRAFFIC.latencies["ping → pong"] = Histogram({-60: 3}, 0.001)
    made = report_of(*EVERY_VERDICT, complaints=["too little"], notJudged=["ipc #1: 3 bytes"])
    made["advice"].append("The two ports may be swapped")
    TRAFFIC.latencies.clear()
    kept = [it for it in made["requirements"] if it["results"] or it["deselected"]]
    made["requirements"] = kept
    loaded: dict[str, Any] = json.loads(json.dumps(made))
    return loaded


def leaves(value: Any, place: Place = ()) -> Iterator[Place]:
    """The places of what is neither object nor array."""
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(each, (*place, key))
    else:
        yield place


def changed(report: dict[str, Any], place: Place, value: Any) -> dict[str, Any]:
    damaged = copy.deepcopy(report)
    inner: Any = damaged
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return damaged


def test_the_schema_is_one_and_describes_every_member() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    for part in parts(SCHEMA):
        for name, member in part.get("properties", {}).items():
            assert {"description", "const", "$ref"} & set(member), name


def test_a_report_of_every_verdict_satisfies_it_and_names_every_requirement() -> None:
    report = json.loads(json.dumps(report_of(*EVERY_VERDICT)))
    closed().validate(report)
    closed().validate([report, report])
    assert [entry["id"] for entry in report["requirements"]] == list(KNOWN)
    verdicts = {entry["id"]: entry["verdict"] for entry in report["requirements"]}
    assert (verdicts["FRM-3"], verdicts["POS-1"]) == ("fail", "skip")
    assert report["observed"] == 4
    assert report["others"][0]["check"] == "collection"


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_comes_back_from_it_as_it_was(text: str) -> None:
    written = json.loads(json.dumps(report_of(failure(text), testee=text)))
    closed().validate(written)
    (told,) = [it for entry in written["requirements"] for it in entry["results"]]
    assert told["text"] == text


def test_no_member_may_be_of_another_type(report: dict[str, Any]) -> None:
    taken = [place for place in leaves(report) if validator().is_valid(changed(report, place, {}))]
    assert taken == []


def test_no_member_may_be_missing(report: dict[str, Any]) -> None:
    objects = {place[:-1] for place in leaves(report) if isinstance(place[-1], str)}
    for place in objects | {()}:
        inner: Any = report
        for key in place:
            inner = inner[key]
        for name in inner:
            damaged = copy.deepcopy(report)
            there: Any = damaged
            for key in place:
                there = there[key]
            del there[name]
            assert not validator().is_valid(damaged), (*place, name)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("format",), "2"),
        (("made",), "yesterday"),
        (("side",), "both"),
        (("exitCode",), 2),
        (("observed",), -1),
        (("profile",), "quicker"),
        (("seeds",), [0.5]),
        (("requirements", 0, "id"), "frm-1"),
        (("requirements", 0, "level"), "SHALL"),
        (("requirements", 2, "results", 0, "verdict"), "passed"),
        (("requirements", 0, "results", 0, "measurements", 0, "worst"), -1.0),
        (("latencies", 0, "bins", 0), [0.1, 0.2]),
        (("latencies", 0, "bins", 0), [0.1, 0.2, 3, 4]),
        (("others", 0, "requirement"), "run"),
    ],
)
def test_what_is_damaged_is_named_by_its_pointer(
    report: dict[str, Any],
    place: Place,
    value: Any,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "report.json"
    path.write_text(json.dumps(changed(report, place, value)), "utf-8")
    assert main(["--plain", "report", str(path), "--badge", str(tmp_path / "badge.json")]) == 2
    output = capsys.readouterr().out
    assert "is no report: /" + "/".join(map(str, place)) in output
    assert not (tmp_path / "badge.json").exists()


def test_reports_of_audits_satisfy_it_and_count_what_was_not_seen(tmp_path: Path) -> None:
    path = tmp_path / "audit.json"
    files = [str(RECORDINGS / f"{name}.jsonl") for name in ("opengl-viewer", "unity-csharp")]
    main(["--plain", "audit", *files, "--json", str(path)])
    written = json.loads(path.read_text("utf-8"))
    closed().validate(written)
    assert [each["side"] for each in written] == ["client", "server"] * 2
    for each in written:
        verdicts = [entry["verdict"] for entry in each["requirements"]]
        assert each["observed"] == len(verdicts) - verdicts.count("skip") > 0
        assert verdicts.count("skip") > 0
        assert (each["version"], each["level"], each["profile"]) == ("1.0", "L0", None)
        assert each["seconds"] > 0


def test_reports_of_a_client_and_of_a_replay_satisfy_it(tmp_path: Path) -> None:
    command = broken(tmp_path, ("if not 1 <= length <= LIMIT:", "if False:"))
    path = tmp_path / "report.json"
    code, output = run(
        *("client", "--launch", command, "--select", "check_bad_length_closes,L0"),
        *("--shrink", "0", "--scripts", str(tmp_path / "scripts"), "--json", str(path)),
    )
    assert code == 1, output
    written = json.loads(path.read_text("utf-8"))
    closed().validate(written)
    assert written["latencies"]
    assert written["summary"] in output
    (script,) = (tmp_path / "scripts").glob("FRM-3*.json")
    code, output = run("replay", str(script), "--launch", command, "--json", str(path))
    assert code == 1, output
    again = json.loads(path.read_text("utf-8"))
    closed().validate(again)
    assert again["summary"] == "FRM-3 is broken again"
    assert [(it["id"], it["verdict"]) for it in again["requirements"]] == [("FRM-3", "fail")]
    code, output = run("replay", str(script), "--launch", GOOD, "--json", str(path))
    assert (code, json.loads(path.read_text("utf-8"))["exitCode"]) == (0, 0), output


def test_a_run_without_a_verdict_leaves_a_report_that_says_so(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    code, output = said("client", "--launch", "/nowhere/my-viewer", "--json", str(path))
    assert code == 3, output
    written = json.loads(path.read_text("utf-8"))
    closed().validate(written)
    assert (written["exitCode"], written["observed"]) == (3, 0)
    assert "cannot start the testee" in written["summary"]
    assert "\n" not in written["summary"]


def test_reports_of_a_server_satisfy_it(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    server = f'"{sys.executable}" -m splatbus_renderer'
    code, output = run("server", "--launch", server, "--select", "NEG-8,L0", "--json", str(path))
    assert code == 0, output
    written = json.loads(path.read_text("utf-8"))
    closed().validate(written)
    assert (written["side"], written["version"]) == ("server", "1.1")


def test_the_demo_writes_what_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Plan, RunOptions]] = []

    def judge(plan: Plan, wishes: RunOptions, _: object) -> int:
        asked.append((plan, wishes))
        return 0

    monkeypatch.setattr(commands, "judge", judge)
    path = tmp_path / "report.html"
    assert main(["--plain", "demo", "--html", str(path)]) == 0
    ((plan, wishes),) = asked
    assert (plan.side, plan.parallel > 1) == ("client", True)
    assert list(wishes.files) == [("html", path)]


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA
