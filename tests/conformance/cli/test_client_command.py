"""`splatbus-conformance client`, run as its user runs it, against the smallest clients."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from splatbus_conformance.data import read_json
from splatbus_conformance.wire.ports import free_port

from tests.conformance.harness import GOOD, MINIATURE, OLD, broken, run, said, start


def test_a_good_client_conforms_and_the_reports_are_written(tmp_path: Path) -> None:
    report, junit = tmp_path / "report.json", tmp_path / "report.xml"
    code, output = run(
        *("client", "--launch", GOOD, "--select", "FRM-1,NEG-8"),
        *("--json", str(report), "--junit", str(junit), "--record", str(tmp_path / "sessions")),
    )
    assert code == 0, output
    assert "conforming at L1" in output
    written = json.loads(report.read_text("utf-8"))
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(written)
    verdicts = {entry["id"]: entry["verdict"] for entry in written["requirements"]}
    assert verdicts["NEG-8"] == verdicts["FRM-1"] == "pass"
    assert b"NEG-8" in junit.read_bytes()
    assert len(list((tmp_path / "sessions").glob("*.jsonl"))) == 2, "introduction, a check"


def test_a_client_without_a_limit_on_lengths_does_not_conform(tmp_path: Path) -> None:
    command = broken(tmp_path, ("if not 1 <= length <= LIMIT:", "if False:"))
    code, output = run("client", "--launch", command, "--select", "FRM-3", "--shrink", "0")
    assert code == 1, output
    assert "not conforming: FRM-3 broken" in output
    assert "A receiver MUST close a connection on which a header announces" in output
    assert "ff ff ff ff" in output or "01 00 10 00" in output or "00 00 00 00" in output


def test_a_client_of_1_0_is_not_judged_by_1_1() -> None:
    code, output = run("client", "--launch", OLD, "--select", "JSN-8,NEG-16,CHN-9")
    assert code == 0, output
    assert "the testee says no hello on the ipc channel: 1.1 is not claimed" in output


def test_waits_for_a_client_that_is_started_by_hand() -> None:
    ports = free_port(), free_port()
    harness = start(
        *("client", "--wait", "--ports", f"{ports[0]},{ports[1]}", "--select", "FRM-3,NEG-8"),
        *("--patience", "30"),
    )
    environment = {"SPLATBUS_IPC_PORT": str(ports[0]), "SPLATBUS_MSG_PORT": str(ports[1])}
    client = subprocess.Popen(
        [sys.executable, str(MINIATURE), "1.1"], env={**os.environ, **environment}
    )
    try:
        output, _ = harness.communicate(timeout=60)
    finally:
        client.kill()
        client.wait()
    assert harness.returncode == 0, output
    assert "Waiting for a client" in output
    assert "may crash a testee that was not launched" in output


@pytest.mark.skipif(os.name == "nt", reason="SIGINT cannot be sent to one process on Windows")
def test_an_interrupt_ends_the_run_and_leaves_no_report_of_before(tmp_path: Path) -> None:
    reports = {name: tmp_path / f"report.{name}" for name in ("json", "junit", "html", "badge")}
    for path in reports.values():
        path.write_text("conforming", "utf-8")
    files = [word for name, path in reports.items() for word in (f"--{name}", str(path))]
    process = start("client", "--launch", GOOD, *files)
    assert process.stdout is not None
    line = process.stdout.readline()
    assert [path.name for path in reports.values() if path.exists()] == []
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=30)
    assert process.returncode == 130, line + output
    written = json.loads(reports["json"].read_text("utf-8"))
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(written)
    assert written["exitCode"] == 130
    assert written["summary"] == "no verdict: the run was interrupted"
    assert b"interrupted" in reports["junit"].read_bytes()
    page = reports["html"].read_text("utf-8")
    assert "the run was interrupted" in page
    assert "Not conforming" not in page
    assert json.loads(reports["badge"].read_text("utf-8"))["message"] == "no verdict"


@pytest.mark.skipif(os.name == "nt", reason="SIGINT cannot be sent to one process on Windows")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("parallel", ["1", "2"])
def test_an_interrupted_run_keeps_what_was_judged(
    tmp_path: Path, parallel: str, ending: signal.Signals
) -> None:
    command = broken(tmp_path, ("if not 1 <= length <= LIMIT:", "if False:"))
    report, junit = tmp_path / "report.json", tmp_path / "report.xml"
    files = "--json", str(report), "--junit", str(junit)
    how = "--launch", command, "--parallel", parallel, "--select", "FRM-3,JSN"
    process = start("client", *how, *files, cwd=tmp_path)
    before = "".join(iter(lambda: _line_before(process, "FRM-3   fail"), ""))
    process.send_signal(ending)
    output, _ = process.communicate(timeout=30)
    assert process.returncode == 130, before + output
    written = json.loads(report.read_text("utf-8"))
    jsonschema.Draft202012Validator(read_json("report.schema.json")).validate(written)
    assert written["summary"].startswith("not conforming: FRM-3")
    assert "checks did not run, for the run was interrupted" in written["summary"]
    verdicts = {entry["id"]: entry["verdict"] for entry in written["requirements"]}
    assert verdicts["FRM-3"] == "fail"
    assert written["claim"] is None
    assert b"the run was interrupted" in junit.read_bytes()
    assert "FAIL FRM-3" in output


def _line_before(process: subprocess.Popen[str], last: str) -> str:
    """A line of what it says; none once that says this."""
    assert process.stdout is not None
    line = process.stdout.readline()
    return "" if last in line else line


def test_a_run_keeps_to_its_time_and_says_what_it_left_out(tmp_path: Path) -> None:
    viewer = f'"{sys.executable}" -m splatbus_viewer view'
    line = "client", "--launch", viewer, "--profile", "full", "--within", "20s", "--parallel", "4"
    code, output = run(*line, cwd=tmp_path)
    assert code == 0, output
    assert "checks did not run, for the time of --within was up" in output
    assert "it may be claimed" not in output


SILENT = f'"{sys.executable}" -c "import time; time.sleep(60)"'
EXITS = f'"{sys.executable}" -c "raise SystemExit(chr(111)*3)"'


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        pytest.param(
            *(["--launch", SILENT, "--patience", "0.5"], 3, "SPLATBUS_IPC_PORT"),
            id="nothing connects",
        ),
        pytest.param(["--launch", EXITS], 3, "ooo", id="it exits at once"),
        (["--wait", "--ports", "0,0", "--patience", "1"], 3, "nothing connected"),
        (["--launch", GOOD, "--wait"], 2, "not allowed with"),
        ([], 2, "required"),
        (["--launch", GOOD, "--select", "FRM-999"], 2, "FRM-999"),
        (["--wait", "--parallel", "2"], 2, "use --launch or --adapter, and leave out --ports"),
        (["--launch", GOOD, "--ports", "1,2", "--parallel", "2"], 2, "and leave out --ports"),
        (["--launch", GOOD, "--within", "0m"], 2, "'0m' is no time: one is wanted such as 90s"),
        (["--launch", GOOD, "--profile", "soak", "--within", "5m"], 2, "as --minutes says"),
        (["--launch", GOOD, "--within", "0.1s"], 2, "to meet the testee alone took"),
        (["--launch", OLD, "--require-version", "1.1", "--select", "FRM-3"], 1, "speaks 1.0 alone"),
        (["--launch", GOOD, "--require-version", "1.1", "--select", "FRM-3"], 0, "conforming"),
    ],
)
def test_what_comes_to_no_check_says_why(words: list[str], code: int, told: str) -> None:
    found, output = said("client", *words)
    assert found == code, output
    assert told in " ".join(output.split())


def test_the_same_seed_draws_the_same_cases() -> None:
    from hypothesis import strategies as st
    from splatbus_conformance.cases.drawing import draw

    numbers = st.lists(st.integers())
    assert draw(numbers, 50, 7) == draw(numbers, 50, 7)
    assert draw(numbers, 50, 7) != draw(numbers, 50, 8)
