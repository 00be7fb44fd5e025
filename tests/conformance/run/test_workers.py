"""Several testees at a time: the same verdicts, no orphans, and no worker that dies unheard."""

import contextlib
import json
import os
import signal
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.data import read_json
from splatbus_conformance.plan import SIDES, Plan, Side
from splatbus_conformance.run.workers import dealt
from splatbus_schemas.requirements import requirements

from tests.conformance.harness import GOOD, broken, run, start
from tests.waiting import eventually

POSIX = pytest.mark.skipif(os.name == "nt", reason="signals and process ids as POSIX has them")
BEGINS = 'if __name__ == "__main__":\n'
"""Of the part of the miniature that runs first."""


def told(path: Path) -> list[tuple[str, str, str]]:
    """The requirement, check and verdict of each result in a report."""
    return [
        (requirement["id"], result["check"], result["verdict"])
        for requirement in json.loads(path.read_text("utf-8"))["requirements"]
        for result in requirement["results"]
    ]


def runs(pid: str, folder: Path) -> bool:
    """Whether this is the number of a testee from there that has not ended: the system gives it to
    others, and what has ended keeps it, without a command, until somebody asks after it.
    """
    try:
        return bytes(folder) in Path("/proc", pid, "cmdline").read_bytes()
    except OSError:
        return False


def noting(tmp_path: Path, what: str) -> tuple[Path, tuple[str, str]]:
    """A folder, and the change that makes each testee leave an empty file there when it starts."""
    folder = tmp_path / "started"
    folder.mkdir()
    return folder, (BEGINS, f"{BEGINS}    Path({str(folder)!r}, {what}).touch()\n")


def test_the_verdicts_are_those_of_a_serial_run_on_ports_of_each_testee_s_own(
    tmp_path: Path,
) -> None:
    started, change = noting(tmp_path, "f'{IPC} {MSG} {os.environ[\"OPENBLAS_NUM_THREADS\"]}'")
    found = []
    for number, command in (("1", GOOD), ("3", broken(tmp_path, change))):
        path, folder = tmp_path / f"{number}.json", tmp_path / number
        code, output = run(
            *("client", "--launch", command, "--select", "NEG-8,NEG-16,CHN-2,FRM-1"),
            *("--parallel", number, "--record", str(folder), "--json", str(path)),
            cwd=tmp_path,
            OPENBLAS_NUM_THREADS="7",
        )
        assert code == 0, output
        assert output.count("Met the client: it speaks 1.1") == 1
        assert output.index("Met the client") < output.index("NEG-8")
        found.append((told(path), sorted(it.name for it in folder.iterdir())))
    assert found[0] == found[1]
    assert len(found[0][0]) > 2
    names = [it.name.split() for it in started.iterdir()]
    ports = [port for *both, _ in names for port in both]
    assert len(ports) == len(set(ports)) == 8  # one of them is met first
    assert {threads for *_, threads in names} == {"7"}, "the testee finds the user's environment"
    assert not (tmp_path / ".hypothesis").exists(), "nothing is left where the user works"


@POSIX
def test_a_worker_that_dies_is_a_harness_error(tmp_path: Path) -> None:
    folder, change = noting(tmp_path, "str(os.getpid())")
    command = broken(tmp_path, ('raise Bad("length")', "os.kill(os.getppid(), 9)"), change)
    path = tmp_path / "report.json"
    code, output = run(
        *("client", "--launch", command, "--select", "FRM-3,NEG-8", "--parallel", "2"),
        *("--json", str(path)),
    )
    assert code == 3, output
    verdicts = {check: verdict for _, check, verdict in told(path) if check != "rule"}
    assert verdicts["check_bad_length_closes"] == "harness-error"
    assert verdicts["check_ignores_unknown_capabilities"] == "pass"
    assert "crashed while running" in output
    for started in folder.iterdir():
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(started.name), signal.SIGKILL)


@POSIX
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_whoever_ends_the_run_ends_every_testee(ending: signal.Signals, tmp_path: Path) -> None:
    """And takes away what the run has put beside them."""
    folder, change = noting(tmp_path, "str(os.getpid())")
    files = Path(tempfile.gettempdir())
    before = {*files.glob("pymp-*")}
    process = start("client", "--launch", broken(tmp_path, change), "--parallel", "3")
    assert eventually(lambda: len(list(folder.iterdir())) >= 3, 60)
    process.send_signal(ending)
    output, _ = process.communicate(timeout=90)
    assert process.returncode in (130, -ending), output
    seconds = 60 * (ending == signal.SIGKILL)
    assert eventually(lambda: not any(runs(it.name, tmp_path) for it in folder.iterdir()), seconds)
    assert eventually(lambda: {*files.glob("pymp-*")} <= before, seconds)


@pytest.mark.parametrize("side", SIDES)
def test_long_checks_are_dealt_first_or_where_time_is_short_each_requirement_once(
    side: Side,
) -> None:
    checks = {it.name: it for it in checks_of(side)}
    plan = Plan(side, None, "", (0, 0), (0, 0), 1.0)
    durations = read_json("durations.json")
    assert {*durations[side], *durations[f"{side} full"]} <= set(checks)
    stored = {name: checks[name] for name in sorted(durations[side])}
    new, *order = dealt({**stored, "check_anew": next(iter(checks.values()))}, plan)
    assert new == "check_anew", "what nobody has measured"
    seconds = [durations[side][name] for name in order]
    assert seconds == sorted(seconds, reverse=True)
    assert dealt(stored, replace(plan, profile="full")) != order
    known, order = requirements("1.1"), dealt(checks, replace(plan, within=60.0))
    seen = [checks[name].requirement for name in order]
    must = [known[id].level.startswith("MUST") for id in seen]
    assert must == sorted(must, reverse=True)
    first = {id for id, is_must in zip(seen, must, strict=True) if is_must}
    assert set(seen[: len(first)]) == first
