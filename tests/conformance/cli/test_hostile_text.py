"""Whatever text reaches the harness from outside, nothing of it acts where its output is read."""

import json
import re
import shlex
import sys
from pathlib import Path

import pytest
from splatbus_conformance.cases.script import Script, as_text
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry
from splatbus_conformance.wire.saving import save

from tests.conformance.harness import run, said
from tests.conformance.reports.stored_reports import failure, report_of

ESCAPES = "\x1b[2J\x1b]0;owned\x07\x9b31m\u202e\u2066\u200b\x08\x0b\r"
ORDERS = "\n::error::owned\n  ::set-output name=a::b\nx ##[error]y ##vso[task.complete]z\n"
HOSTILE = f"a{ESCAPES}{ORDERS}{'w' * 300} ::error::owned [red][/bold] :boom:"
NAME = HOSTILE.replace("/", "|")[:200].replace("\n", " ")
ORDER = re.compile(r"^\s*::|##\[|##\w+\[", re.MULTILINE)
PRINTS = f'"{sys.executable}" -c {shlex.quote(f"import sys; sys.exit({HOSTILE!a})")}'


def assert_harmless(output: str, told: str = r"\x1b[2J") -> None:
    assert all(each.isprintable() or each == "\n" for each in output), repr(output)
    assert not ORDER.search(output), output
    assert told in output, "or it was not shown at all"


def session(path: Path) -> Path:
    """A recording in which both sides say hostile things wherever there is room for them."""
    says = {
        "c2s": [{"type": "hello", "versions": ["1.1"], "capabilities": [HOSTILE], "client": NAME}],
        "s2c": [
            {"type": "error", "code": HOSTILE, "message": HOSTILE},
            {"type": "welcome", "version": HOSTILE, "server": HOSTILE},
            {HOSTILE: HOSTILE, "type": HOSTILE},
        ],
    }
    entries = [Entry(0.0, "ipc", 1, event="open"), Entry(0.0, "msg", 1, event="open")]
    for direction, messages in says.items():
        for message in messages:
            data = packet(json.dumps(message).encode())
            entries += (Entry(1.0, it, 1, direction, data) for it in ("ipc", "msg"))  # type: ignore[arg-type]
    save(entries, path)
    return path


@pytest.mark.parametrize("side", ["client", "server"])
def test_what_a_testee_prints(side: str) -> None:
    status, output = run(side, "--launch", PRINTS, "--patience", "2")
    assert status == 3
    assert_harmless(output)


def test_what_an_adapter_prints() -> None:
    status, output = run("client", "--adapter", PRINTS, "--patience", "2")
    assert status == 3
    assert_harmless(output)


def test_a_recording_that_is_judged_and_its_name(tmp_path: Path) -> None:
    path = session(tmp_path / f"{NAME}.jsonl")
    status, output = run("audit", str(path))
    assert status == 1
    assert_harmless(output)


def test_a_recording_that_is_played_again(tmp_path: Path) -> None:
    path = session(tmp_path / "session.jsonl")
    status, output = run("replay", str(path), "client", "--launch", PRINTS, "--patience", "2")
    assert status in (1, 3)
    assert_harmless(output, "Played")


@pytest.mark.parametrize("kind", ["--junit", "--html", "--markdown", "--badge"])
def test_a_stored_report_and_what_is_made_of_it(kind: str, tmp_path: Path) -> None:
    stored = report_of(
        failure(HOSTILE), testee=HOSTILE, summary=HOSTILE, complaints=[HOSTILE], advice=[HOSTILE]
    )
    stored["requirements"][0]["sentence"] = HOSTILE
    stored["environment"] = dict.fromkeys(stored["environment"], HOSTILE)
    path, made = tmp_path / "report.json", tmp_path / "made"
    path.write_text(json.dumps(stored), "utf-8")
    status, output = run("report", str(path), kind, str(made))
    assert status == 0
    assert_harmless(output)
    text = made.read_text("utf-8")
    assert all(each.isprintable() or each in "\n\t" for each in text)


def test_a_report_that_is_none(tmp_path: Path) -> None:
    path = tmp_path / f"{NAME}.json"
    path.write_text(json.dumps({HOSTILE: HOSTILE, "format": HOSTILE}), "utf-8")
    status, output = run("report", str(path), "--html", str(tmp_path / "page.html"))
    assert status == 2
    assert_harmless(output)


def test_a_script_that_is_delivered(tmp_path: Path) -> None:
    path = tmp_path / "script.json"
    path.write_text(as_text(Script("client", "FRM-3", HOSTILE, False, (), seen=HOSTILE)), "utf-8")
    status, output = run("replay", str(path), "--launch", PRINTS, "--patience", "2")
    assert status in (2, 3)
    assert_harmless(output)


@pytest.mark.parametrize(
    "words",
    [
        [HOSTILE],
        ["audit", HOSTILE],
        ["audit", NAME, "--peer", HOSTILE],
        ["client", "--wait", "--ports", HOSTILE],
        ["client", "--wait", "--select", HOSTILE],
        ["client", "--wait", "--html", f"/nowhere/{NAME}"],
        ["client", "--wait", "--expect-failures", f"/nowhere/{NAME}"],
        ["client", "--launch", f'{HOSTILE} "'],
        ["client", "--launch", "x", f"--{HOSTILE}"],
        ["server", "--connect", "--host", NAME, "--patience", "1"],
        ["proxy", "--to", HOSTILE],
        ["proxy", "--record", f"/nowhere/{NAME}"],
        ["replay", HOSTILE],
        ["report", HOSTILE],
        ["explain", HOSTILE],
    ],
    ids=lambda words: " ".join(words)[:24].encode("unicode_escape").decode(),
)
def test_what_an_argument_says(words: list[str]) -> None:
    status, output = said(*words)
    assert status in (2, 3), output
    assert_harmless(output)
