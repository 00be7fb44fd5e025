"""The token of who runs the harness is in nothing that it leaves behind."""

import shlex
import sys
from pathlib import Path

import pytest
from splatbus_conformance.cases.script import Case, Script, as_text
from splatbus_conformance.cli.arguments import plan_of
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.plan import Usage
from splatbus_conformance.run.failures import work_out
from splatbus_conformance.run.options import as_options
from splatbus_conformance.trials.testee.process import Launched
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_conformance.wire.secrets import hidden

from tests.conformance.harness import run
from tests.waiting import eventually

TOKEN = "only-for-those-who-may"


@pytest.fixture(autouse=True)
def variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPLATBUS_TOKEN", TOKEN)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (f"serve --token {TOKEN} --quiet", "serve --token $SPLATBUS_TOKEN --quiet"),
        ("serve --token=other", "serve --token=$SPLATBUS_TOKEN"),
        ("serve --token 'of two words' -v", "serve --token $SPLATBUS_TOKEN -v"),
        ("serve --token-file t.txt", "serve --token-file t.txt"),
        (f"it said {TOKEN!r}", "it said '$SPLATBUS_TOKEN'"),
    ],
)
def test_a_text_names_the_variable_instead(text: str, shown: str) -> None:
    assert hidden(text) == shown
    assert hidden(shown) == shown


def test_a_short_one_is_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPLATBUS_TOKEN", "e")
    assert hidden("serve") == "serve"


def test_no_script_holds_it_nor_the_command_that_shows_it_again(tmp_path: Path) -> None:
    command = f"serve --token {TOKEN}"
    plan = plan_of("server", parser().parse_args(["server", "--launch", command]))
    script = Script("server", "FRM-3", "check_a", False, ((Case(False, 0),),), transcript=(TOKEN,))
    failed = Result("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, TOKEN, script=as_text(script))
    (told,) = work_out(plan, [failed], tmp_path, 0.0, print)
    (written,) = tmp_path.iterdir()
    assert TOKEN not in written.read_text("utf-8")
    assert TOKEN not in told.replay
    assert "--launch 'serve --token $SPLATBUS_TOKEN'" in told.replay
    again = parser().parse_args(["server", *as_options(plan)])
    assert again.launch == "serve --token $SPLATBUS_TOKEN"


def test_a_command_finds_it_in_the_environment_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "said"
    program = f"import pathlib, sys; pathlib.Path({str(file)!r}).write_text(sys.argv[1])"
    command = f'"{sys.executable}" -c {shlex.quote(program)} $SPLATBUS_TOKEN'
    testee = Launched(command, {})
    testee.ensure_running()
    assert eventually(lambda: file.exists() and file.read_text() == TOKEN)
    testee.close()
    assert TOKEN not in " ".join((testee.name, *testee.argv))
    monkeypatch.delenv("SPLATBUS_TOKEN")
    with pytest.raises(Usage, match="SPLATBUS_TOKEN: set that"):
        Launched(command, {})


def test_no_report_holds_it(tmp_path: Path) -> None:
    prints = f"import sys; print(sys.argv); sys.exit({TOKEN!r})"
    command = f'"{sys.executable}" -c {shlex.quote(prints)} --token {TOKEN}'
    report = tmp_path / "report.json"
    status, _ = run("server", "--launch", command, "--patience", "1", "--json", str(report))
    assert status == 3
    told = report.read_text("utf-8")
    assert TOKEN not in told
    assert "--token', '$SPLATBUS_TOKEN" in told


@pytest.mark.parametrize("says", [True, False])
def test_it_is_said_that_a_server_lets_in_who_does_not_say_it(says: bool) -> None:
    command = f'"{sys.executable}" -m splatbus_renderer --quiet'
    command = command if says else f"env -u SPLATBUS_TOKEN {command}"
    status, output = run("server", "--launch", command, "--select", "NEG-30")
    assert status == 0
    assert ("the server lets in who does not say it" in output) is not says
