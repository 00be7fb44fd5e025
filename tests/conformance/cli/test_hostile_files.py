"""Files that break every rule of their format: a sentence that says where, and no traceback."""

import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.cases.script import Case, Script, as_text
from splatbus_conformance.wire.recording import MOST_LINE

from tests.conformance.harness import said
from tests.conformance.reports.stored_reports import brief, changed, full_report, places

BYTES = {"t": 0.5, "channel": "msg", "conn": 1, "dir": "c2s", "hex": "1c00"}
SCRIPT = Script("client", "FRM-3", "check_x", False, ((Case(True, "a"),),))
FILES: dict[str, tuple[list[str], Any]] = {
    "event.jsonl": (["audit"], {"t": 0.5, "channel": "msg", "conn": 1, "event": "open"}),
    "session.jsonl": (["audit"], BYTES),
    "report.json": (["report"], brief(full_report())),
    "script.json": (["replay"], json.loads(as_text(SCRIPT))),
    "list.toml": (["client", "--launch", "x", "--expect-failures"], {}),
}
"""What reads a file, and what stands in one that is as it should be."""
JSON = [name for name in FILES if not name.endswith("toml")]
ODD = (
    *(None, True, -1, 1.5, "x", "", [], {}, [[]], 10**400, 2**70),
    *(float("nan"), float("inf"), 1e-320, "\ud800", "\x1b[2J", "FRM-3\n", {"a": "b" * 10_000}),
)
NUMBERS = ("1e400", "-1e400", "NaN", "Infinity", "9" * 5000, f"0.{'9' * 5000}")
NESTS = ("[" * 200_000, f'{{"a": {"[" * 200_000}', "{" * 99_999, '{"a":' * 99_999, "\x00")


def line(path: Path) -> list[str]:
    made = [f"--{kind}={path.parent / kind}" for kind in ("html", "junit", "markdown", "badge")]
    more = {"report": made, "replay": ["--launch", "./not-there", "--patience", "0.1"]}
    command, _ = FILES[path.name]
    return [*command, str(path), *more.get(command[0], [])]


def status(path: Path, text: str) -> int:
    """Of the command that reads this text, whose file it names if it is to blame."""
    path.write_text(text, "utf-8")
    found, output = said(*line(path))
    assert "Traceback" not in output, output
    assert "the harness failed" not in output, output
    assert found in (0, 1, 2, 3), output
    if found == 2:
        assert path.name in output
        assert len(output) < 20_000
    return found


@pytest.mark.parametrize("name", JSON)
def test_anything_may_stand_anywhere(name: str, tmp_path: Path) -> None:
    path, (_, good) = tmp_path / name, FILES[name]
    found = set()
    for number, at in enumerate(places(good)):
        for odd in ODD[number % 3 :: 3]:  # another third in the next place
            found.add(status(path, json.dumps(changed(good, at, odd))))
    assert 2 in found


@pytest.mark.parametrize("name", JSON)
def test_no_number_and_no_nest_is_too_much(name: str, tmp_path: Path) -> None:
    path, (_, good) = tmp_path / name, FILES[name]
    assert [status(path, text) for text in NESTS] == [2] * len(NESTS)
    for number in NUMBERS:
        text = json.dumps({**good, "odd": 0}).replace('"odd": 0', f'"odd": {number}')
        assert (status(path, text) == 2) == (not number.startswith("0.") or name == "script.json")


def test_a_recording_may_go_back_in_time_and_a_report_have_a_million_faults(tmp_path: Path) -> None:
    lines = [{**BYTES, "t": -number, "conn": number} for number in range(300)]
    status(tmp_path / "session.jsonl", "\n".join(map(json.dumps, lines)))
    faulty = {**FILES["report.json"][1], "complaints": [0] * 100_000}
    assert status(tmp_path / "report.json", json.dumps(faulty)) == 2


@pytest.mark.skipif(sys.platform != "linux", reason="it limits what a process may take")
@pytest.mark.parametrize("name", [*FILES][1:])
def test_a_gigabyte_in_a_line_takes_no_gigabyte(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    with path.open("wb") as file:
        file.write(b'{"t": "')
        file.truncate(1 << 30)  # which takes no disk
    done = subprocess.run(
        [sys.executable, "-m", "splatbus_conformance", "--plain", *line(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (700 << 20, 700 << 20)),
        timeout=60,
    )
    assert done.returncode == 2, done.stdout
    assert path.name in done.stdout
    assert "Traceback" not in done.stdout


def test_the_longest_line_is_read_and_no_longer_one(tmp_path: Path) -> None:
    digits = (MOST_LINE - len(json.dumps({**BYTES, "hex": ""}))) // 2 * 2
    path = tmp_path / "session.jsonl"
    assert status(path, json.dumps({**BYTES, "hex": "0" * digits})) != 2
    assert status(path, json.dumps({**BYTES, "hex": "0" * (digits + 2)})) == 2
