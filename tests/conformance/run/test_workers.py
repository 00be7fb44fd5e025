"""Several testees at a time: the same verdicts, no orphans, and no worker that dies unheard."""

import contextlib
import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.data import read_json
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.run.workers import dealt
from splatbus_schemas.requirements import requirements

from tests.conformance.harness import GOOD, broken, run, start
from tests.waiting import eventually

SOME = "NEG-8,NEG-16,CHN-2"
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


def runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def wait_for(path: Path, count: int) -> list[str]:
    """The names in a folder, once there are so many."""
    assert eventually(lambda: len(list(path.iterdir())) >= count, 60)
    return [it.name for it in path.iterdir()]


def noting(tmp_path: Path, what: str) -> tuple[Path, tuple[str, str]]:
    """A folder, and the change that makes each testee leave an empty file there when it starts."""
    folder = tmp_path / "started"
    folder.mkdir()
    return folder, (BEGINS, f"{BEGINS}    Path({str(folder)!r}, {what}).touch()\n")


def test_the_verdicts_are_those_of_a_serial_run_on_ports_of_each_testee_s_own(
    tmp_path: Path,
) -> None:
    started, change = noting(tmp_path, 'f"{IPC} {MSG}"')
    reports = []
    for number, command in (("1", GOOD), ("3", broken(tmp_path, change))):
        path, folder = tmp_path / f"{number}.json", tmp_path / number
        code, output = run(
            *("client", "--launch", command, "--select", SOME, "--json", str(path)),
            *("--parallel", number, "--record", str(folder)),
        )
        assert code == 0, output
        reports.append(told(path))
        assert output.count("Met the client: it speaks 1.1") == 1
        assert output.index("Met the client") < output.index("NEG-8")
    assert reports[0] == reports[1]
    assert len(reports[0]) > 2
    names = [sorted(it.name for it in (tmp_path / number).iterdir()) for number in ("1", "3")]
    assert names[0] == names[1]
    ports = [port for it in started.iterdir() for port in it.name.split()]
    assert len(ports) == len(set(ports)) == 8  # one of them is met first


def test_workers_without_a_check_say_what_they_saw_when_they_met_the_testee() -> None:
    code, output = run("client", "--launch", GOOD, "--select", "FRM-1,FRM-2", "--parallel", "2")
    assert code == 0, output
    assert "conforming at L0: 2 of" in output


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
def test_an_interrupt_ends_every_worker_and_its_testee(tmp_path: Path) -> None:
    folder, change = noting(tmp_path, "str(os.getpid())")
    process = start("client", "--launch", broken(tmp_path, change), "--parallel", "3")
    wait_for(folder, 3)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=90)
    assert process.returncode == 130, output
    assert [pid for pid in map(int, wait_for(folder, 3)) if runs(pid)] == []


@POSIX
def test_testees_end_with_a_controller_that_is_killed(tmp_path: Path) -> None:
    folder, change = noting(tmp_path, "str(os.getpid())")
    process = start("client", "--launch", broken(tmp_path, change), "--parallel", "2")
    wait_for(folder, 2)
    process.kill()
    process.communicate()
    assert eventually(lambda: not any(runs(int(it.name)) for it in folder.iterdir()), 60)


def test_a_worker_keeps_nothing_from_its_testee_and_leaves_nothing(tmp_path: Path) -> None:
    folder, change = noting(tmp_path, 'os.environ["OPENBLAS_NUM_THREADS"]')
    code, output = run(
        *("client", "--launch", broken(tmp_path, change), "--select", "NEG-8"),
        *("--parallel", "2"),
        cwd=tmp_path,
        OPENBLAS_NUM_THREADS="7",
    )
    assert code == 0, output
    found = [it.name for it in folder.iterdir()]
    assert found == ["7"], "the testee finds the user's environment"
    assert not (tmp_path / ".hypothesis").exists(), "nothing is left where the user works"


@pytest.mark.parametrize("side", ["client", "server"])
def test_long_checks_come_first_and_before_them_what_nobody_has_measured(side: Side) -> None:
    checks = {it.name: it for it in checks_of(side)}
    plan, anew = Plan(side, None, "", (0, 0), (0, 0), 1.0), next(iter(checks.values()))
    seconds = read_json("durations.json")[side]
    stored = {name: checks[name] for name in sorted(seconds)}
    new, *order = dealt({**stored, "check_anew": anew}, plan)
    assert new == "check_anew"
    assert [seconds[name] for name in order] == sorted(seconds.values(), reverse=True)
    assert dealt(stored, replace(plan, profile="full")) != order


@pytest.mark.parametrize("side", ["client", "server"])
def test_where_time_is_short_each_requirement_is_seen_once_before_any_is_seen_twice(
    side: Side,
) -> None:
    checks = {it.name: it for it in checks_of(side)}
    order = dealt(checks, Plan(side, None, "", (0, 0), (0, 0), 1.0, within=60.0))
    known, seen = requirements("1.1"), [checks[name].requirement for name in order]
    must = [known[id].level.startswith("MUST") for id in seen]
    assert must == sorted(must, reverse=True)
    first = {id for id, is_must in zip(seen, must, strict=True) if is_must}
    assert set(seen[: len(first)]) == first


@pytest.mark.parametrize("side", ["client", "server"])
def test_durations_are_of_checks_that_there_are(side: Side) -> None:
    stored = read_json("durations.json")
    assert {*stored[side], *stored[f"{side} full"]} <= {it.name for it in checks_of(side)}
