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
from tests.conformance.reports.stored_reports import of_a_testee

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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording, a report, a script and what is none, which say hostile things wherever there is
    room for them.
    """
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
    save(entries, tmp_path / f"{NAME}.jsonl")
    report = of_a_testee(HOSTILE)
    report["requirements"][0]["sentence"] = HOSTILE
    report["environment"] = dict.fromkeys(report["environment"], HOSTILE)
    (tmp_path / "report.json").write_text(json.dumps(report), "utf-8")
    (tmp_path / NAME).write_text(json.dumps({HOSTILE: HOSTILE, "format": HOSTILE}), "utf-8")
    script = Script("client", "FRM-3", HOSTILE, False, (), seen=HOSTILE)
    (tmp_path / "script.json").write_text(as_text(script), "utf-8")
    return tmp_path


@pytest.mark.parametrize(
    "how", [["client", "--launch"], ["client", "--adapter"], ["server", "--launch"]]
)
def test_what_a_testee_prints(how: list[str]) -> None:
    status, output = run(*how, PRINTS, "--patience", "2")
    assert status == 3
    assert_harmless(output)


@pytest.mark.parametrize(
    ("line", "status"),
    [
        (["audit", f"{NAME}.jsonl"], 1),
        (["replay", f"{NAME}.jsonl", "client", "--launch", PRINTS, "--patience", "2"], 3),
        (["report", "report.json", "--junit", "made"], 0),
        (["report", "report.json", "--html", "made"], 0),
        (["report", "report.json", "--markdown", "made"], 0),
        (["report", "report.json", "--badge", "made"], 0),
        (["report", NAME, "--html", "made"], 2),
        (["replay", "script.json", "--launch", PRINTS, "--patience", "2"], 3),
        ([HOSTILE], 2),
        (["audit", NAME, "--peer", HOSTILE], 2),
        (["client", "--wait", "--ports", HOSTILE], 2),
        (["client", "--wait", "--select", HOSTILE], 2),
        (["client", "--wait", "--html", f"/nowhere/{NAME}"], 2),
        (["client", "--wait", "--expect-failures", f"/nowhere/{NAME}"], 2),
        (["client", "--launch", f'{HOSTILE} "'], 2),
        (["client", "--launch", "x", f"--{HOSTILE}"], 2),
        (["server", "--connect", "--host", NAME, "--patience", "1"], 3),
        (["proxy", "--to", HOSTILE], 2),
        (["replay", HOSTILE], 2),
        (["explain", HOSTILE], 2),
    ],
    ids=lambda line: ascii(line)[:40],
)
def test_what_a_file_or_an_argument_says(
    line: list[str], status: int, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    found, output = said(*line)
    assert found == status, output
    assert_harmless(output)
    if "made" in line and status == 0:
        text = (folder / "made").read_text("utf-8")
        assert all(each.isprintable() or each in "\n\t" for each in text)
