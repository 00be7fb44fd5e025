"""The command line: its examples, what it lists, and what it refuses before anything starts."""

import io
import json
import shlex
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest
import splatbus_renderer.cli
import splatbus_viewer.cli
from splatbus_conformance.cli import selftest
from splatbus_conformance.cli.arguments import plan_of
from splatbus_conformance.cli.examples import EXAMPLES
from splatbus_conformance.cli.main import main
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.plan import SIDES
from splatbus_conformance.reports.console import PLAIN_WIDTH, console
from splatbus_conformance.reports.files.stored import validator
from splatbus_conformance.verdicts import EXIT_INTERRUPTED
from splatbus_schemas import LIMITS, version
from splatbus_schemas.requirements import requirements

from tests.conformance.harness import run, said

LINES = [
    line.strip()
    for text in EXAMPLES.values()
    for line in text.replace("\\\n", "").splitlines()
    if line.startswith("  splatbus-conformance")
]
RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
VIEWER, UNITY = (str(RECORDINGS / f"{it}.jsonl") for it in ("opengl-viewer", "unity-csharp"))


@pytest.mark.parametrize("line", LINES)
def test_examples_are_command_lines(line: str) -> None:
    program, *words = shlex.split(line)
    assert program == "splatbus-conformance"
    given = parser().parse_args(words)
    if given.command == "replay":
        side = [] if given.how[0] in SIDES else ["client"]
        given = parser().parse_args([*side, *given.how])
    if given.command in ("client", "server"):
        plan_of(given.command, given)


@pytest.mark.parametrize("command", EXAMPLES)
def test_help_ends_with_examples_and_fits_a_terminal(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    status, output = said(*filter(None, [command, "--help"]))
    assert status == 0
    assert output.endswith(EXAMPLES[command])
    assert max(map(len, output.splitlines())) <= 100


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("client --launch x --ports 6001", "give two numbers"),
        ("client --launch x --ports 6001,6001", "IPC and message need a port each"),
        ("client --launch x --ports 6001,65536", "to 65535"),
        ("client --launch x --ports=-1,6000", "a port is a number from 0"),
        ("client --launch x --viewport 0x48", "1 to"),
        (f"client --launch x --viewport {LIMITS['max_image_size'] + 1}x1", "1 to"),
        ("client --launch x --viewport big", "'big': give a size such as 640x480"),
        ("client --launch ' '", "' ': give a command, such as ./my-viewer"),
        ("client --adapter ''", "'': give a command, such as ./my-viewer"),
        ("client --launch x --require-coverage 101%", "give a whole number of percent"),
        ("client --launch x --wait", "not allowed with"),
        ("client", "required"),
        ("client --launch x --select FRM-999", "FRM-999"),
        ("client --wait --parallel 2", "use --launch or --adapter, and leave out --ports"),
        ("client --launch x --ports 1,2 --parallel 2", "and leave out --ports"),
        ("client --launch x --record /dev/null/a", "--record: /dev/null/a: Not a directory"),
        ("client --launch x --parallel 0", "'0': give a whole number from 1 on, such as 4"),
        ("client --launch x --within 0m", "'0m': give a time such as 90s"),
        ("client --launch x --profile soak --within 5m", "whose length is --minutes"),
        (
            "client --wait --stand-in-cuda",
            "only in a program that it starts: use --launch or --adapter",
        ),
        ("clinet --launch x", "did you mean client?"),
        ("client --launch x --profile QUICK", "did you mean quick?"),
        ("audit x.jsonl --peer sever", "did you mean server?"),
        ("audit x.jsonl", "No such file"),
        (f"audit {__file__}", "line 1"),
        (f"replay {UNITY} --launch x", "say which one to judge"),
        ("explain FRM3", "did you mean FRM-3?"),
        ("explain FMR-3", "did you mean FRM-3"),
        ("explain FRM", "a clause, with FRM-1, FRM-2"),
        ("explain zzz", "the clauses are ACC"),
    ],
)
def test_what_cannot_be_meant_is_refused_and_what_is_near_is_named(line: str, told: str) -> None:
    status, output = said(*shlex.split(line))
    assert status == 2
    assert told in " ".join(output.split())


def test_free_ports_may_be_asked_for_twice() -> None:
    given = parser().parse_args(["client", "--launch", "x", "--ports", "0,0"])
    assert plan_of("client", given).ports == (0, 0)


@pytest.mark.parametrize("terminal", [True, False])
def test_plain_lines_fit_the_terminal_if_there_is_one_and_what_it_lacks_is_replaced(
    terminal: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = io.BytesIO()
    out = io.TextIOWrapper(raw, encoding="ascii")
    monkeypatch.setattr(out, "isatty", lambda: terminal)
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setenv("COLUMNS", "70")
    plain = console(True)
    plain.print("client → server ✓")
    out.flush()
    assert raw.getvalue().decode().split() == ["client", "?", "server", "?"]
    assert plain.width == (70 if terminal else PLAIN_WIDTH)


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("splatbus-conformance", main),
        ("splatbus-server", splatbus_renderer.cli.main),
        ("splatbus-client", splatbus_viewer.cli.main),
    ],
)
def test_the_version_is_that_of_the_distribution(
    name: str, command: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        command(["--version"])
    assert capsys.readouterr().out == f"{name} {metadata.version('splatbus-protocol')}\n"


def test_it_runs_where_nothing_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(version, "DISTRIBUTION", "no-such-distribution")
    assert version.installed_version() == "unknown"


@pytest.mark.parametrize(
    ("line", "status", "told"),
    [
        ([VIEWER, "--peer", "client"], 1, ["client: not conforming: JSN-4", "/position/x"]),
        ([VIEWER, "--peer", "server"], 0, ["server: conforming at L0"]),
        ([UNITY], 0, ["client: conforming at L0", "advice not followed: FRM-7", "server: "]),
        ([UNITY, "--peer", "client", "--strict"], 1, ["advice not followed: FRM-7"]),
        ([VIEWER, UNITY], 1, ["JSN-4"]),
        (["/dev/null"], 3, ["no verdict: nothing was observed"]),
    ],
)
def test_recordings_are_judged(
    line: list[str], status: int, told: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "audit.json"
    found, output = said("audit", *line, "--json", str(path))
    assert found == status
    assert [each for each in told if each not in output] == []
    reports = json.loads(path.read_text("utf-8"))
    validator().validate(reports)
    for report in reports:
        skipped = sum(it["verdict"] == "skip" for it in report["requirements"])
        assert report["observed"] == len(report["requirements"]) - skipped
        assert f"{report['side']}: {report['summary']}" in output


def test_every_requirement_is_listed_and_explained() -> None:
    status, output = said("list")
    assert status == 0
    assert set(requirements("1.1")) <= set(output.split())
    status, output = said("explain", *(name.lower() for name in requirements("1.1")))
    assert status == 0
    plain = " ".join(output.split())
    for name, it in requirements("1.1").items():
        told = plain[plain.index(f"{name} {it.level} {it.chapter}") :]
        assert " ".join(it.sentence.split()) in told
        assert [peer for peer in it.binds if f" {peer} " not in told] == []


def test_an_interrupt_ends_with_its_status_wherever_it_comes(tmp_path: Path) -> None:
    """Python notes one in an `exec`, and would end `python -m` by the signal."""
    (tmp_path / "interrupted.py").write_text(
        "import sys\n"
        "from splatbus_conformance.cli import main\n"
        "main.COMMANDS['demo'] = lambda *_: exec('raise KeyboardInterrupt')\n"
        "sys.exit(main.main(['demo']))\n",
        "utf-8",
    )
    line = [sys.executable, "-m", "interrupted"]
    ended = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (EXIT_INTERRUPTED, "interrupted\n")


def test_the_selftest_is_a_judge_of_the_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    code, output = run("selftest")
    assert (code, output.splitlines()[-1]) == (0, "13 of 13 are judged correctly"), output
    harmless = selftest.Row("FRM-3", "is as it was", "MAX_PAYLOAD:", "MAX_PAYLOAD :")
    monkeypatch.setattr(selftest, "ROWS", (harmless,))
    code, output = said("selftest")
    assert (code, output.splitlines()[-1]) == (1, "1 of 2 are judged correctly"), output
