"""Every command on the pages that people read works, or the page says why it is not run.

What a command judges is one of our own programs under the name of the reader's (`desk.py`), and its
ports are free ones. Apart from that:

- a command that judges nothing, or replays, is run word for word, one of those that differ only in
  the requirement or the program;
- one that judges is run with `--profile brief --select …` behind it: this shows that its
  options go together and reach the testee, not that the testee passes all, for which there are
  other tests. Of several that differ only in the program that they start, its patience, its size
  or the selection, one is run;
- one that writes a list of expected failures takes a whole run. One is run, with the brief profile;
  of the others, which differ in the testee alone, the options are read.
"""

import os
import re
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest
import splatbus_splats.cli
import splatbus_viewer.cli
from splatbus_conformance.cases.script import load
from splatbus_conformance.cli.arguments import plan_of, wishes_of
from splatbus_conformance.cli.parsing import parser

from tests.guides import desk
from tests.guides.pages import ALL, SHELLS, Block, our_commands

AT_A_TIME = 4
"""Most of their time commands wait."""
BLOCKS = [block for block in ALL if block.language == "sh"]


def commands(block: Block) -> list[str]:
    """What is run of a block: each line, or all of it where lines need each other."""
    return [block.text] if "eval" in block.text else block.text.splitlines()


LINES = list(
    dict.fromkeys(line for block in BLOCKS if not block.why_not_run for line in commands(block))
)
JUDGING = [line for line in LINES if any(f" {side} " in line for side in ("client", "server"))]
VARIED = re.compile(
    r"(?<=launch|dapter) (\"[^\"]*\"|\S+)| --(patience|viewport|select) \S+"
    r"|(?<=explain) \S+|(?<=replay) \S+"
)


def one_of_a_kind(lines: list[str]) -> list[str]:
    """The last of several that differ in nothing but what varies, on one side."""
    return list({(VARIED.sub("", line), "my_renderer" in line): line for line in lines}.values())


READ = [line for line in LINES if "--write-expected" in line and "my-viewer" not in line]
RUN = one_of_a_kind([line for line in LINES if line not in READ])
UNTIL = {
    "proxy": "nothing broken so far",
    "python": "picture.ppm",
    "eval": "image ",
    "splatbus-server": "ready",
}
"""What shows that a program which runs until it is stopped has done its work."""


def shortened(line: str) -> str:
    if line not in JUDGING:
        return line
    brief = f"{line} --profile brief --shrink 0"
    if "--write-expected" in line:
        return brief
    return f"{brief} --select {'CNV-1' if '--require-level' in line else 'FRM-1'}"


def until(line: str) -> str:
    return next((text for name, text in UNTIL.items() if re.match(rf"(\S+ )?{name}\b", line)), "")


def beside(line: str) -> str:
    if "--wait" in line:
        return "client"
    served = ("--connect", "proxy", "snapshot", "minimal_client")
    return "server" if any(word in line for word in served) else ""


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Future[desk.Outcome]]]:
    """All commands, run a few at a time, each in a folder of its own."""

    base = tmp_path_factory.mktemp("desks")  # the factory is not for several threads

    def run(line: str) -> desk.Outcome:
        folder = Path(tempfile.mkdtemp(dir=base))
        desk.prepare(folder, line)
        return desk.run(folder, shortened(line), beside(line), until(line))

    with ThreadPoolExecutor(AT_A_TIME) as pool:
        yield {line: pool.submit(run, line) for line in RUN}


def test_each_block_is_run_or_says_why_not() -> None:
    """Everything that is run is a command of ours, or a Python program of the guides, and none
    hides in a block of another kind.
    """
    for line in LINES:
        first = line.split()[0]
        known = first in ("python", "eval") or first.startswith("splatbus-")
        assert known, f"{line!r} is not run by this test: say why in a comment above its block"
    for block in ALL:
        assert not block.why_not_run or len(block.why_not_run.split()) > 3, f"{block}: say why"
        assert block.language in ("", *SHELLS) or not our_commands(block), block


@pytest.mark.skipif(os.name == "nt", reason="the commands are for a shell")
@pytest.mark.parametrize("line", RUN)
def test_a_command_works(line: str, outcomes: dict[str, Future[desk.Outcome]]) -> None:
    outcome = outcomes[line].result()
    told = f"{line}\nstatus {outcome.status}\n{outcome.output}"
    if "--require-coverage" in line:
        assert outcome.status == 1, told
        assert "--require-coverage" in outcome.output, told
    elif not any(name in line for name in ("eval", "minimal_client", "proxy")):
        assert outcome.status == 0, told
        if line in JUDGING and "replay" not in line:
            assert "conforming at L" in outcome.output, told
    for option in ("--json", "--junit", "--html", "--markdown", "--badge", "--record"):
        if f"{option} " in line:
            assert line.split(f"{option} ")[1].split()[0] in outcome.files, told
    if sign := until(line):
        assert sign in outcome.output or sign in outcome.files, told


@pytest.mark.parametrize("block", [b for b in ALL if our_commands(b)], ids=str)
def test_the_options_of_each_command_exist_and_go_together(
    block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of those that are not run, and of lists of commands that belong to no shell."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "known.toml").touch()
    for name, *arguments in our_commands(block):
        if "--help" in arguments:
            continue
        if name == "splatbus-server":
            splatbus_splats.cli.parser().parse_intermixed_args(arguments)
        elif name == "splatbus-client":
            splatbus_viewer.cli._parser().parse_args(arguments)
        else:
            found = parser().parse_args(arguments)
            if found.command == "replay" and re.search(r"[A-Z]{3}-\d", found.file):
                desk.write_script(Path(found.file))
                found = parser().parse_args([load(Path(found.file)).side, *found.how])
            if found.command in ("client", "server"):
                assert plan_of(found.command, found)
                assert wishes_of(found.command, found)
            elif found.command == "replay" and found.file.endswith(".jsonl"):
                parser().parse_args(found.how)  # the words say themselves to whom
