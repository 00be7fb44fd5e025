"""Files that break every rule of their format: a sentence that says where, and no traceback."""

import copy
import json
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.cases.script import Case, Script, as_text
from splatbus_conformance.wire.recording import MOST_LINE

from tests.conformance.harness import said
from tests.conformance.reports.stored_reports import FAR_OFF, failure, report_of

BYTES = {"t": 0.5, "channel": "msg", "conn": 1, "dir": "c2s", "hex": "1c00"}
ODD = (
    *(None, True, -1, 1.5, "x", "", [], {}, [[]], 10**400, 2**70),
    *(float("nan"), float("inf"), 1e-320, "\ud800", "\x1b[2J", "FRM-3\n", {"a": "b" * 10_000}),
)
DEEP = "[" * 200_000
NUMBERS = ("1e400", "-1e400", "NaN", "Infinity", "9" * 5000, f"0.{'9' * 5000}")


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where something stands in a document; of lists the first alone."""
    if at:
        yield at
    inside = value.items() if isinstance(value, dict) else ()
    for name, each in enumerate(value[:1]) if isinstance(value, list) else inside:
        yield from places(each, (*at, name))


def changed(value: Any, at: tuple[Any, ...], new: Any) -> Any:
    made = copy.deepcopy(value)
    inner = made
    for name in at[:-1]:
        inner = inner[name]
    inner[at[-1]] = new
    return made


def assert_told(status: int, output: str, path: Path) -> None:
    assert "Traceback" not in output, output
    assert "the fault is its own" not in output, output
    assert status in (0, 1, 2, 3), output
    assert len(output) < 20_000 or status != 2
    if status == 2:
        assert path.name in output


@pytest.mark.parametrize("name", [*BYTES, "event"])
def test_a_line_of_a_recording_with_anything_anywhere(name: str, tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    for odd in ODD:
        path.write_text(f"{json.dumps(BYTES)}\n{json.dumps({**BYTES, name: odd})}\n", "utf-8")
        status, output = said("audit", str(path))
        assert_told(status, output, path)
        if status == 2:
            assert f"{path.name}, line 2: " in output


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("name", ["t", "conn", "note"])
def test_a_number_that_is_none_in_a_recording(number: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    path.write_text(json.dumps({**BYTES, name: 0}).replace(f'"{name}": 0', f'"{name}": {number}'))
    assert_told(*said("audit", str(path)), path)


@pytest.mark.parametrize("line", [DEEP, f'{{"a": {DEEP}', "{" * 99_999, '{"a":' * 99_999, "\x00"])
@pytest.mark.parametrize("command", [["audit"], ["report"], ["replay"]], ids=" ".join)
def test_nests_that_are_too_deep(command: list[str], line: str, tmp_path: Path) -> None:
    path = tmp_path / ("session.jsonl" if command == ["audit"] else "file.json")
    path.write_text(line)
    more = {"report": ["--html", str(tmp_path / "p")], "replay": ["--launch", "x"]}
    status, output = said(*command, str(path), *more.get(command[0], []))
    assert status == 2
    assert_told(status, output, path)


def test_times_that_go_back_and_connections_that_never_end(tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    lines = [{**BYTES, "t": -number, "conn": number} for number in range(300)]
    path.write_text("\n".join(map(json.dumps, lines)))
    assert_told(*said("audit", str(path)), path)


@pytest.mark.skipif(sys.platform != "linux", reason="it limits what a process may take")
@pytest.mark.parametrize("name", ["session.jsonl", "report.json", "script.json", "list.toml"])
def test_a_gigabyte_in_a_line_takes_no_gigabyte(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    with path.open("wb") as file:
        file.write(b'{"t": "')
        file.truncate(1 << 30)  # which takes no disk
    command = {
        "session.jsonl": ["audit", str(path)],
        "report.json": ["report", str(path), "--html", str(tmp_path / "page.html")],
        "script.json": ["replay", str(path), "--launch", "x"],
        "list.toml": ["client", "--launch", "x", "--expect-failures", str(path)],
    }[name]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_DATA, (700 << 20, 700 << 20))

    done = subprocess.run(
        [sys.executable, "-m", "splatbus_conformance", "--plain", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=limit,
        timeout=60,
    )
    assert done.returncode == 2, done.stdout
    assert_told(done.returncode, done.stdout, path)


def test_the_longest_line_is_read_and_no_longer_one(tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    empty = json.dumps({**BYTES, "hex": ""})
    for more, wanted in ((0, 0), (2, 2)):
        digits = (MOST_LINE - len(empty)) // 2 * 2 + more
        path.write_text(json.dumps({**BYTES, "hex": "0" * digits}))
        status, output = said("audit", str(path))
        assert (status == 2) == (wanted == 2), output


def stored() -> dict[str, Any]:
    broken = failure("seen")
    report = report_of(broken, complaints=["a"], advice=["b"], notJudged=["c"])
    report["latencies"] = [
        {"what": "a", "count": 1, "p50": 1.0, "p99": 1.0, "max": 1.0, "bins": [[0.1, 1.0, 1]]}
    ]
    report["requirements"] = [it for it in report["requirements"] if it["results"]]
    report["requirements"][0]["results"][0]["measurements"] = [FAR_OFF.as_json()]
    report["requirements"][0]["deselected"] = ["check_a"]
    report["others"] = [{"requirement": "", **report["requirements"][0]["results"][0]}]
    return json.loads(json.dumps(report))


PLACES = list(places(stored()))


@pytest.mark.parametrize("at", PLACES, ids=lambda at: "/".join(map(str, at)))
def test_a_report_with_anything_anywhere(at: tuple[Any, ...], tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    made = [f"--{kind}={tmp_path / kind}" for kind in ("html", "junit", "markdown", "badge")]
    for odd in ODD[PLACES.index(at) % 3 :: 3]:  # another third in the next place
        path.write_text(json.dumps(changed(stored(), at, odd)), "utf-8")
        status, output = said("report", str(path), *made)
        assert status in (0, 2), output
        assert_told(status, output, path)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_number_that_is_none_in_a_report(number: str, tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    text = json.dumps(stored()).replace('"seconds": ', f'"seconds": {number}, "x": ', 1)
    path.write_text(text, "utf-8")
    status, output = said("report", str(path), "--html", str(tmp_path / "page.html"))
    assert_told(status, output, path)
    assert (status == 2) == (not number.startswith("0.")), output


def test_a_million_faults_are_told_briefly(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text(json.dumps({**stored(), "complaints": [0] * 100_000}), "utf-8")
    status, output = said("report", str(path), "--html", str(tmp_path / "page.html"))
    assert status == 2
    assert_told(status, output, path)


SCRIPT = json.loads(as_text(Script("client", "FRM-3", "check_x", False, ((Case(True, "a"),),))))


@pytest.mark.parametrize("at", list(places(SCRIPT)), ids=lambda at: "/".join(map(str, at)))
def test_a_script_with_anything_anywhere(at: tuple[Any, ...], tmp_path: Path) -> None:
    path = tmp_path / "script.json"
    for odd in ODD:
        path.write_text(json.dumps(changed(SCRIPT, at, odd)), "utf-8")
        status, output = said("replay", str(path), "--launch", "./not-there", "--patience", "0.1")
        assert status in (2, 3), output
        assert_told(status, output, path)
