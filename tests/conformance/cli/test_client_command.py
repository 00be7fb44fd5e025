"""`splatbus-conformance client` and `replay`, run as their user runs them, against the smallest
clients.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.reports.files.stored import validator
from splatbus_conformance.wire.ports import free_port

from tests.conformance.harness import GOOD, MINIATURE, OLD, broken, run, said, start

BREAKS_FRM_3 = ("if not 1 <= length <= LIMIT:", "if False:")
POSIX = pytest.mark.skipif(os.name == "nt", reason="SIGINT cannot be sent to one process there")


def stored(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """A report that satisfies its schema, and its verdicts."""
    report = json.loads(path.read_text("utf-8"))
    validator().validate(report)
    return report, {entry["id"]: entry["verdict"] for entry in report["requirements"]}


def test_a_good_client_conforms_and_what_is_asked_for_is_written(tmp_path: Path) -> None:
    path, sessions = tmp_path / "report.json", tmp_path / "sessions"
    code, output = run(
        *("client", "--launch", GOOD, "--select", "FRM-1,NEG-8"),
        *("--json", str(path), "--record", str(sessions)),
    )
    assert code == 0, output
    assert "conforming at L1" in output
    report, verdicts = stored(path)
    assert verdicts["NEG-8"] == verdicts["FRM-1"] == "pass"
    assert report["summary"] in output
    assert report["latencies"]
    assert len(list(sessions.glob("*.jsonl"))) == 2, "introduction, a check"


def test_a_client_that_breaks_a_rule_does_not_and_its_script_shows_it_again(tmp_path: Path) -> None:
    command, path = broken(tmp_path, BREAKS_FRM_3), tmp_path / "report.json"
    select = "check_bad_length_closes,L0"
    code, output = run(
        *("client", "--launch", command, "--select", select, "--shrink", "0"),
        *("--scripts", str(tmp_path / "scripts"), "--json", str(path)),
    )
    assert code == 1, output
    assert "not conforming: FRM-3 broken" in output
    assert "A receiver MUST close a connection on which a header announces" in output
    assert any(it in output for it in ("ff ff ff ff", "01 00 10 00", "00 00 00 00")), output
    assert stored(path)[1]["FRM-3"] == "fail"
    (script,) = (tmp_path / "scripts").glob("FRM-3*.json")
    for launch, status, verdict in ((command, 1, "fail"), (GOOD, 0, "pass")):
        code, output = run("replay", str(script), "--launch", launch, "--json", str(path))
        report, verdicts = stored(path)
        assert (code, report["exitCode"], verdicts) == (status, status, {"FRM-3": verdict}), output
        assert ("is broken again" in report["summary"]) == bool(status)


def test_a_client_of_1_0_is_not_judged_by_1_1() -> None:
    code, output = run("client", "--launch", OLD, "--select", "JSN-8,NEG-16,CHN-9")
    assert code == 0, output
    assert "the testee says no hello on the ipc channel: 1.1 is not claimed" in output


def test_waits_for_a_client_that_is_started_by_hand() -> None:
    ipc, msg = str(free_port()), str(free_port())
    select = ("--select", "FRM-3,NEG-8", "--patience", "30")
    harness = start("client", "--wait", "--ports", f"{ipc},{msg}", *select)
    environment = {**os.environ, "SPLATBUS_IPC_PORT": ipc, "SPLATBUS_MSG_PORT": msg}
    with subprocess.Popen([sys.executable, str(MINIATURE), "1.1"], env=environment) as client:
        output, _ = harness.communicate(timeout=60)
        client.kill()
    assert harness.returncode == 0, output
    assert "Waiting for a client" in output
    assert "may crash a testee that was not launched" in output


@POSIX
def test_an_interrupt_at_once_leaves_no_report_of_before(tmp_path: Path) -> None:
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
    report, _ = stored(reports["json"])
    assert report["exitCode"] == 130
    assert report["summary"] == "no verdict: the run was interrupted"
    assert [name for name, path in reports.items() if not path.exists()] == []


@POSIX
@pytest.mark.parametrize(
    ("ending", "parallel"), [(signal.SIGINT, "1"), (signal.SIGTERM, "1"), (signal.SIGINT, "2")]
)
def test_an_interrupted_run_keeps_what_was_judged(
    tmp_path: Path, parallel: str, ending: signal.Signals
) -> None:
    path = tmp_path / "report.json"
    how = "--launch", broken(tmp_path, BREAKS_FRM_3), "--parallel", parallel, "--json", str(path)
    process = start("client", *how, "--select", "FRM-3,JSN", cwd=tmp_path)
    assert process.stdout is not None
    before = ""
    while "FRM-3   fail" not in before:
        line = process.stdout.readline()
        assert line, before
        before += line
    process.send_signal(ending)
    output, _ = process.communicate(timeout=30)
    assert process.returncode == 130, before + output
    report, verdicts = stored(path)
    assert report["summary"].startswith("not conforming: FRM-3")
    assert "checks did not run, for the run was interrupted" in report["summary"]
    assert (verdicts["FRM-3"], report["claim"]) == ("fail", None)
    assert "FAIL FRM-3" in output


def test_a_run_keeps_to_its_time_and_says_what_it_left_out(tmp_path: Path) -> None:
    viewer = f'"{sys.executable}" -m splatbus_viewer view'
    line = "client", "--launch", viewer, "--profile", "full", "--within", "20s", "--parallel", "4"
    code, output = run(*line, cwd=tmp_path)
    assert code == 0, output
    assert "checks did not run, for the time of --within was up" in output
    assert "you may claim" not in output


SILENT = f'"{sys.executable}" -c "import time; time.sleep(60)"'
EXITS = f'"{sys.executable}" -c "raise SystemExit(chr(111)*3)"'


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["--launch", SILENT, "--patience", "0.5"], 3, "SPLATBUS_IPC_PORT"),
        (["--launch", EXITS], 3, "ooo"),
        (["--launch", "/nowhere/my-viewer"], 3, "cannot start the testee"),
        (["--wait", "--ports", "0,0", "--patience", "1"], 3, "nothing connected"),
        (["--launch", GOOD, "--within", "0.1s"], 2, "to meet the testee alone took"),
        (["--launch", OLD, "--require-version", "1.1", "--select", "FRM-3"], 1, "speaks only 1.0"),
        (["--launch", GOOD, "--require-version", "1.1", "--select", "FRM-3"], 0, "conforming"),
    ],
    ids=lambda words: str(words)[-30:],
)
def test_a_run_without_checks_says_why_and_leaves_a_report_that_says_so(
    words: list[str], status: int, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "report.json"
    found, output = said("client", *words, "--json", str(path))
    assert found == status, output
    assert told in " ".join(output.split())
    assert path.exists() == (status != 2)
    if status != 2:
        report, _ = stored(path)
        assert report["exitCode"] == status
        assert "\n" not in report["summary"]
