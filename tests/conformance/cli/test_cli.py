"""The command line: its examples, and what it refuses before anything is started."""

import io
import os
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
from splatbus_conformance.cli.options import FORMATS
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.plan import SIDES, Usage
from splatbus_conformance.reports.console import console
from splatbus_conformance.verdicts import EXIT_INTERRUPTED
from splatbus_schemas import LIMITS, version

from tests.conformance.harness import run, said

LINES = [
    line.strip()
    for text in EXAMPLES.values()
    for line in text.replace("\\\n", "").splitlines()
    if line.startswith("  splatbus-conformance")
]


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


@pytest.mark.parametrize("command", [name for name in EXAMPLES if name])
def test_help_ends_with_the_examples_of_its_command_and_fits_a_terminal(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as end:
        main([command, "--help"])
    assert end.value.code == 0
    output = capsys.readouterr().out
    assert output.endswith(EXAMPLES[command])
    examples = [line for line in LINES if line.split()[1] == command]
    assert len(examples) > (command == "client")
    assert max(map(len, output.splitlines())) <= 100


@pytest.mark.parametrize("command", ["client", "server", "demo", "audit", "proxy"])
def test_every_run_offers_every_format(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    output = capsys.readouterr().out
    assert [name for name in FORMATS if f"--{name} FILE" not in output] == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--launch", "x", "--ports", "6001"], "two numbers are wanted"),
        (["--launch", "x", "--ports", "6001,6001"], "IPC and message need a port each"),
        (["--launch", "x", "--ports", "6001,65536"], "to 65535"),
        (["--launch", "x", "--ports=-1,6000"], "a port is a number from 0"),
        (["--launch", "x", "--viewport", "0x48"], "1 to"),
        (["--launch", "x", "--viewport", f"{LIMITS['max_image_size'] + 1}x1"], "1 to"),
        (["--launch", "x", "--viewport", "big"], "width and height are wanted"),
    ],
)
def test_what_cannot_be_meant_is_refused(words: list[str], told: str) -> None:
    with pytest.raises(Usage, match=told):
        plan_of("client", parser().parse_args(["client", *words]))


def test_free_ports_may_be_asked_for_twice() -> None:
    given = parser().parse_args(["client", "--launch", "x", "--ports", "0,0"])
    assert plan_of("client", given).ports == (0, 0)


@pytest.mark.parametrize("option", ["--launch", "--adapter"])
@pytest.mark.parametrize("command", ["", " "])
def test_a_blank_command_is_none(
    option: str, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["client", option, command])
    assert end.value.code == 2
    assert "a command is wanted" in capsys.readouterr().err


def test_a_terminal_that_lacks_a_character_gets_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    console(True).print("client → server ✓")
    sys.stdout.flush()
    assert raw.getvalue().decode().split() == ["client", "?", "server", "?"]


@pytest.mark.skipif(sys.platform == "win32", reason="it takes a terminal of POSIX")
@pytest.mark.parametrize(("terminal", "most"), [(True, 70), (False, 240)])
def test_plain_lines_fit_the_terminal_if_there_is_one(terminal: bool, most: int) -> None:
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 70, 0, 0))
    environment = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
    done = subprocess.run(
        [sys.executable, "-m", "splatbus_conformance", "--plain", "explain", "CHN-20"],
        stdin=theirs if terminal else subprocess.DEVNULL,
        stdout=theirs if terminal else subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
    )
    os.close(theirs)
    output = os.read(ours, 1 << 16) if terminal else done.stdout
    os.close(ours)
    longest = max(len(line.rstrip()) for line in output.decode().splitlines())
    assert most / 2 < longest <= most


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
    with pytest.raises(SystemExit) as end:
        command(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"{name} {metadata.version('splatbus-protocol')}\n"


def test_it_runs_where_nothing_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(version, "DISTRIBUTION", "no-such-distribution")
    assert version.installed_version() == "unknown"


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["clinet", "--launch", "x"], "did you mean client?"),
        (["client", "--launch", "x", "--profile", "ful"], "did you mean full?"),
        (["client", "--launch", "x", "--profile", "QUICK"], "did you mean quick?"),
        (["audit", "x.jsonl", "--peer", "sever"], "did you mean server?"),
    ],
)
def test_a_word_that_is_not_known_is_answered_with_what_is_near(
    words: list[str], hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    assert hint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("FRM3", "did you mean FRM-3?"),
        ("frm_3", "did you mean FRM-3"),
        ("FMR-3", "did you mean FRM-3"),
        ("FRM", "a clause, with FRM-1, FRM-2"),
        ("zzz", "the families are ACC"),
    ],
)
def test_an_id_that_is_none_is_answered_with_what_is_near(
    word: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--plain", "explain", word]) == 2
    assert told in capsys.readouterr().out


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
    assert (code, output.splitlines()[-1]) == (0, "13 of 13 are judged as they must be"), output
    harmless = selftest.Row("FRM-3", "is as it was", "MAX_PAYLOAD:", "MAX_PAYLOAD :")
    monkeypatch.setattr(selftest, "ROWS", (harmless,))
    code, output = said("selftest")
    assert (code, output.splitlines()[-1]) == (1, "1 of 2 are judged as they must be"), output
