"""Where reports go: asked before the run, and made again from a stored one."""

import json
import os
from pathlib import Path

import pytest
from splatbus_conformance.cli import commands
from splatbus_conformance.cli.main import main
from splatbus_conformance.cli.options import FORMATS

from tests.conformance.reports.stored_reports import EVERY_VERDICT, HOSTILE, failure, report_of

RECORDING = str(Path(__file__).parents[3] / "data" / "recordings" / "unity-csharp.jsonl")
OTHERS = [name for name in FORMATS if name != "json"]
RUNS = [
    ["client", "--launch", "viewer"],
    ["server", "--launch", "renderer"],
    ["demo"],
    ["audit", RECORDING],
    ["proxy"],
]


def asked_for(folder: Path, names: list[str]) -> list[str]:
    return [word for name in names for word in (f"--{name}", str(folder / name))]


@pytest.fixture
def stored(tmp_path: Path) -> str:
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report_of(*EVERY_VERDICT, *map(failure, HOSTILE))), "utf-8")
    return str(path)


@pytest.mark.parametrize("line", RUNS, ids=lambda line: str(line[0]))
@pytest.mark.parametrize("name", FORMATS)
def test_what_cannot_be_written_is_said_before_the_run(
    line: list[str],
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def begun(*_: object, **__: object) -> int:
        raise AssertionError("the run began")

    for step in ("judge", "judge_recording"):
        monkeypatch.setattr(commands, step, begun)
    monkeypatch.setattr("splatbus_conformance.observe.proxy.session", begun)
    path = tmp_path / "nowhere" / "report"
    assert main(["--plain", *line, f"--{name}", str(path)]) == 2
    output = capsys.readouterr().out
    assert f"--{name} {path}: there is no folder {path.parent}" in output
    assert main(["--plain", *line, f"--{name}", str(tmp_path)]) == 2
    assert f"--{name} {tmp_path}: it cannot be written" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--write-expected", "--scripts"])
def test_so_are_lists_and_scripts(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "below"
    assert main(["--plain", "client", "--launch", "viewer", option, str(path)]) == 2
    assert f"{option} {path}: " in capsys.readouterr().out


def test_asking_leaves_no_file_and_changes_none(tmp_path: Path) -> None:
    (tmp_path / "html").write_text("older", "utf-8")
    line = ["--plain", "audit", str(tmp_path / "no.jsonl"), *asked_for(tmp_path, list(FORMATS))]
    assert main(line) == 2
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
        assert (first / name).stat().st_size > 50


def test_a_summary_is_appended_and_the_rest_is_written_anew(stored: str, tmp_path: Path) -> None:
    main(["--plain", "report", stored, *asked_for(tmp_path, OTHERS)])
    once = {name: (tmp_path / name).read_bytes() for name in OTHERS}
    main(["--plain", "report", stored, *asked_for(tmp_path, OTHERS)])
    for name in OTHERS:
        times = 2 if name == "markdown" else 1
        assert (tmp_path / name).read_bytes() == once[name] * times, name


def test_a_file_that_is_full_gets_no_more_than_github_shows(stored: str, tmp_path: Path) -> None:
    path = tmp_path / "summary.md"
    path.write_bytes(b"x" * ((1 << 20) - 2000))
    assert main(["--plain", "report", stored, "--markdown", str(path)]) == 0
    assert 1500 < path.stat().st_size - ((1 << 20) - 2000) <= 2000


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "cannot be read"),
        ("{", "is no JSON"),
        ("\xff", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
        ("[]", "is no report: the whole"),
        ("3", "is no report: the whole"),
        ("{}", "is no report: the whole: 'format' is a required property"),
        ("[{}]", "is no report: /0: 'format' is a required property"),
    ],
)
def test_what_is_no_report_is_told_so(
    text: str | None, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "report.json"
    if text is not None:
        path.write_bytes(text.encode("latin-1"))
    assert main(["--plain", "report", str(path), "--html", str(tmp_path / "page.html")]) == 2
    assert told in capsys.readouterr().out


def test_a_report_has_to_be_made_into_something(
    stored: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--plain", "report", stored]) == 2
    assert "--html" in capsys.readouterr().out


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")
def test_a_disk_that_is_full_is_told_after_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--plain", "audit", RECORDING, "--json", "/dev/full"]) == 2
    output = capsys.readouterr().out
    assert f"--json /dev/full: it cannot be written: {os.strerror(28)}" in output
    assert "client: conforming at L0" in output
