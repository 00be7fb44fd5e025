"""Where reports go: asked before the run, and made again from a stored one."""

import json
import os
from pathlib import Path

import pytest
from splatbus_conformance.cli import commands
from splatbus_conformance.cli.main import main
from splatbus_conformance.cli.options import FORMATS

from tests.conformance.harness import said
from tests.conformance.reports.stored_reports import brief, changed, full_report, of_a_testee

RECORDING = str(Path(__file__).parents[3] / "data" / "recordings" / "unity-csharp.jsonl")
OTHERS = [name for name in FORMATS if name != "json"]


def asked_for(folder: Path, names: list[str]) -> list[str]:
    return [word for name in names for word in (f"--{name}", str(folder / name))]


@pytest.fixture
def stored(tmp_path: Path) -> str:
    path = tmp_path / "report.json"
    path.write_text(json.dumps([full_report(), of_a_testee("`" * 9000)]), "utf-8")
    return str(path)


@pytest.mark.parametrize(
    "line", ["client --launch it", "server --launch it", "demo", f"audit {RECORDING}", "proxy"]
)
def test_what_cannot_be_written_is_said_before_the_run(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for step in ("judge", "judge_recording"):
        monkeypatch.setattr(commands, step, None)
    monkeypatch.setattr("splatbus_conformance.observe.proxy.session", None)
    path = tmp_path / "nowhere" / "report"
    options = [*FORMATS, "write-expected", "scripts"] if "launch" in line else FORMATS
    for option in options:
        for bad, told in (
            (path, f"there is no folder {path.parent}"),
            (tmp_path, "it cannot be written"),
            (Path("/dev/null/below"), "/dev/null"),
        ):
            if option != "scripts" or bad.is_relative_to("/dev"):
                status, output = said(*line.split(), f"--{option}", str(bad))
                assert status == 2
                assert f"--{option} {bad}: " in output
                assert told in output


def test_asking_leaves_no_file_and_changes_none(tmp_path: Path) -> None:
    (tmp_path / "html").write_text("older", "utf-8")
    line = ["audit", str(tmp_path / "no.jsonl"), *asked_for(tmp_path, list(FORMATS))]
    assert said(*line)[0] == 2
    assert [path.name for path in tmp_path.iterdir()] == ["html"]
    assert (tmp_path / "html").read_text("utf-8") == "older"


def test_what_a_run_writes_is_what_its_stored_report_is_made_into(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    assert main(["--plain", "audit", RECORDING, *asked_for(first, list(FORMATS))]) == 0
    assert main(["--plain", "report", str(first / "json"), *asked_for(second, OTHERS)]) == 0
    for name in OTHERS:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_a_summary_is_appended_up_to_what_github_shows_and_the_rest_is_written_anew(
    stored: str, tmp_path: Path
) -> None:
    line = ["--plain", "report", stored, *asked_for(tmp_path, OTHERS)]
    assert main(line) == 0
    once = {name: (tmp_path / name).read_bytes() for name in OTHERS}
    assert main(line) == 0
    for name in OTHERS:
        times = 2 if name == "markdown" else 1
        assert (tmp_path / name).read_bytes() == once[name] * times, name
    (tmp_path / "markdown").write_bytes(b"x" * ((1 << 20) - 2000))
    assert main(line) == 0
    assert 500 < (tmp_path / "markdown").stat().st_size - ((1 << 20) - 2000) <= 2000


GOOD = brief(full_report())


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "No such file"),
        ("{", "is not JSON"),
        ("\xff", "is not JSON"),
        ("[]", "is not a report: $: "),
        ("[{}]", "is not a report: $[0]: 'format' is a required property"),
        (json.dumps(changed(GOOD, ("format",), "2")), "$.format: "),
        (json.dumps(changed(GOOD, ("made",), "yesterday")), "$.made: "),
        (json.dumps(changed(GOOD, ("exitCode",), 2)), "$.exitCode: "),
        (json.dumps(changed(GOOD, ("requirements", 0, "id"), "frm-1")), "$.requirements[0].id: "),
        (json.dumps(changed(GOOD, ("complaints",), [0] * 9)), "$.complaints[2]: 0 is not of type"),
        (json.dumps(changed(GOOD, ("complaints",), [0] * 9)), "; and 6 more"),
        (json.dumps(changed(GOOD, ("complaints",), [0] * 999)), "; and at least 97 more"),
    ],
)
def test_what_is_no_report_is_told_so(text: str | None, told: str, tmp_path: Path) -> None:
    path, page = tmp_path / "report.json", tmp_path / "page.html"
    if text is not None:
        path.write_bytes(text.encode("latin-1"))
    status, output = said("report", str(path), "--html", str(page))
    assert (status, page.exists()) == (2, False)
    assert told in " ".join(output.split())


def test_a_report_has_to_be_made_into_something(stored: str) -> None:
    status, output = said("report", stored)
    assert (status, "--html" in output) == (2, True)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")
def test_a_disk_that_is_full_is_told_after_the_run() -> None:
    status, output = said("audit", RECORDING, "--json", "/dev/full")
    assert status == 2
    assert f"--json /dev/full: it cannot be written: {os.strerror(28)}" in output
    assert "client: conforming at L0" in output
