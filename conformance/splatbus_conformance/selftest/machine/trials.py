"""Judge a mutant that was made by machine: by the harness, and by the tests."""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_conformance.plan import Side
from splatbus_conformance.selftest.machine import lines, specimens
from splatbus_conformance.selftest.machine.importing import CHANGE
from splatbus_conformance.selftest.machine.lines import Lines
from splatbus_conformance.selftest.machine.modules import OWN, Drawn
from splatbus_conformance.selftest.trials import Cell, cells_of, run_harness
from splatbus_conformance.verdicts import EXIT_NO_VERDICT, Verdict

ROOT = Path(__file__).parents[4]
RUN_SECONDS = 400.0
"""The longest that all checks may take; a watched reference takes several times its own."""
TESTS_SECONDS = 400.0
TEST_SECONDS = 60
"""A single test that takes so long hangs: usually the slowest takes four."""
Executed = Mapping[Side, Lines]
_testing: set[subprocess.Popen[str]] = set()
HANGS = "they hang"
PARTNER = "unity"
"""Whose axes the client's adapter uses."""


class Phase(NamedTuple):
    """One run of the harness on a mutant; the cheap ones come first."""

    profile: str
    axes: str = ""
    environment: dict[str, str] | None = None


PHASES: Mapping[Side, tuple[Phase, ...]] = {
    "client": (Phase("brief", PARTNER), Phase("quick", PARTNER)),
    "server": (
        Phase("brief"),
        Phase("brief", environment={"SPLATBUS_TOKEN": "a token that both are given"}),
        Phase("quick"),
    ),
}


class Fate(StrEnum):
    """What the harness makes of a mutant; of several sides and runs the first of these counts."""

    KILLED = "killed"
    """A MUST is broken."""
    CRASHED = "the harness failed"
    UNMET = "not met"
    """It does not come as far as to be judged."""
    NO_VERDICT = "no verdict"
    """The run did not come to an end in time."""
    WARNED = "warned"
    """A SHOULD is broken, and nothing else."""
    SURVIVED = "survived"
    UNTOUCHED = "not executed"
    """No run of the harness executes its line, so that none was made."""


class ByTests(StrEnum):
    """What our tests make of it."""

    KILLED = "killed"
    SURVIVED = "survived"
    UNKNOWN = "unknown"
    """They were not asked, or fail on what is unchanged too."""


@dataclass(frozen=True)
class Judged:
    """What came of one mutant."""

    name: str
    line: int
    before: str
    after: str
    fate: Fate
    tested: ByTests
    by: str = ""
    """Which run found what."""
    test: str = ""
    """The first that failed."""
    seconds: Mapping[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """For the stored result."""
        return asdict(self)

    @classmethod
    def from_json(cls, members: dict[str, Any]) -> "Judged":
        """The reverse."""
        fate, tested = Fate(members["fate"]), ByTests(members["tested"])
        return cls(**{**members, "fate": fate, "tested": tested})


class Opinion(NamedTuple):
    """What the harness found."""

    fate: Fate
    by: str = ""


def judge(drawn: Drawn, executed: Executed | None = None, former: str = "") -> Judged:
    """By the harness on each side that executes what was changed, and by the tests.

    Where nobody looked what is executed, by the harness only, and first by the check, and then by
    the run, that killed it formerly.
    """
    began = time.monotonic()
    opinion = by_harness(drawn, executed, former)
    judged_at = time.monotonic()
    it = drawn.change
    tested, first = by_tests(it.name) if executed else (ByTests.UNKNOWN, "")
    seconds = {
        "harness": round(judged_at - began, 1),
        "tests": round(time.monotonic() - judged_at, 1),
    }
    return Judged(
        it.name, it.line, it.before, it.after, opinion.fate, tested, opinion.by, first, seconds
    )


def by_harness(drawn: Drawn, executed: Executed | None, former: str = "") -> Opinion:
    """The worst that is found, one run after the other until one breaks a MUST."""
    sides = [
        side
        for side in drawn.sides
        if executed is None or lines.executes(executed[side], drawn.change)
    ]
    every = max(map(len, PHASES.values()))
    runs = [
        (side, it) for number in range(every) for side in sides for it in PHASES[side][number:][:1]
    ]
    runs.sort(key=lambda run: not former.startswith(f"{_words(*run)}: "))
    check = re.search(r": \S+ (check_\w+): ", former)
    if check and former.startswith(f"{_words(*runs[0])}: "):
        opinion = _by_run(drawn.change.name, *runs[0], "--select", check[1])
        if opinion.fate is Fate.KILLED:
            return opinion
    found = [Opinion(Fate.UNTOUCHED)]
    unmet: set[Side] = set()
    for side, phase in runs:
        if side in unmet:
            continue
        opinion = _by_run(drawn.change.name, side, phase)
        if opinion.fate is Fate.UNMET:
            unmet.add(side)
            if phase.axes:  # what cannot speak through its adapter may do so by itself
                opinion = _by_run(drawn.change.name, side, Phase(phase.profile))
        if opinion.fate is Fate.KILLED:
            return opinion
        found.append(opinion)
    order = list(Fate)
    return min(found, key=lambda opinion: order.index(opinion.fate))


def _words(side: Side, phase: Phase) -> str:
    names = phase.environment or {}
    return " ".join(filter(None, (side, phase.profile, phase.axes, *names)))


def _by_run(change: str, side: Side, phase: Phase, *options: str) -> Opinion:
    name = specimens.named(specimens.CHANGED, side, phase.axes, change)
    more = ("--profile", phase.profile, "--parallel", "1", "--exitfirst", *options)
    report, status, last_words = run_harness(
        name, side, "", RUN_SECONDS, phase.axes, more, phase.environment
    )
    cells = cells_of(report) + [
        Cell(it["requirement"], it["check"], it["verdict"], it["text"])
        for it in (report or {}).get("others", [])
    ]
    run = _words(side, phase)
    if report is None:
        return Opinion(Fate.NO_VERDICT, f"{run}: {last_words}")
    for verdict, fate in (
        (Verdict.FAIL, Fate.KILLED),
        (
            Verdict.ERROR,
            Fate.UNMET if status == EXIT_NO_VERDICT and _unmet(cells) else Fate.CRASHED,
        ),
        (Verdict.WARN, Fate.WARNED),
    ):
        if told := [cell for cell in cells if cell.verdict == verdict]:
            it = told[0]
            return Opinion(fate, f"{run}: {it.requirement} {it.check}: {it.text}"[:300])
    return Opinion(Fate.SURVIVED)


def _unmet(cells: list[Cell]) -> bool:
    return any(cell.check == "run" for cell in cells)


def by_tests(change: str) -> tuple[ByTests, str]:
    """Run the tests of the changed module's package, and of those that stand upon it.

    The one that fails has to pass on what is unchanged, else it says nothing.
    """
    failed = _failing(tests_of(change.partition(":")[0]), change)
    if failed is None:
        return ByTests.SURVIVED, ""
    if failed and failed != HANGS and _failing([failed]) is not None:
        return ByTests.UNKNOWN, f"{failed} fails on what is unchanged too"
    return ByTests.KILLED, failed


def _failing(tests: Iterable[Path | str], change: str = "") -> str | None:
    """The first test that fails, the empty text where they cannot even be read, or None."""
    with tempfile.TemporaryDirectory(prefix="splatbus-tests-") as folder:
        line = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "--tb=no"]
        line += ["-p", "no:cacheprovider", "-o", f"timeout={TEST_SECONDS}", *map(str, tests)]
        line += ["-p", f"{__package__}.under_test"] if change else []
        environment = {**os.environ, CHANGE: change, "OPENBLAS_NUM_THREADS": "1"}
        environment |= {"HYPOTHESIS_STORAGE_DIRECTORY": folder, "TMPDIR": folder}
        process = subprocess.Popen(
            line,
            cwd=ROOT,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        _testing.add(process)
        try:
            output, _ = process.communicate(timeout=TESTS_SECONDS)
        except subprocess.TimeoutExpired:
            return HANGS
        finally:
            process.kill()
            process.wait()
            _testing.discard(process)
    if process.returncode == 0:
        return None
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.MULTILINE)
    return failed[1] if failed else ""


def stop_tests() -> None:
    """End the tests that run now."""
    for process in list(_testing):
        process.kill()


def tests_of(module: str) -> Iterator[Path]:
    """The files of tests that meet this module, those that are about it first."""
    package, _, name = module.rpartition(".")
    sides = [side for side in OWN if package in ("splatbus_wire", f"splatbus_{side}")]
    own = package.removeprefix("splatbus_")
    folders = dict.fromkeys((own, *sides, "pair"))
    files = [path for it in folders for path in sorted((ROOT / "tests" / it).glob("test_*.py"))]
    texts = {path: path.read_text("utf-8") for path in files}
    return iter(
        sorted(
            files,
            key=lambda path: (
                not re.search(rf"\b{name}\b", path.stem.replace("_", " "))
                and name not in path.stem,
                not re.search(rf"\b{package}\.{name}\b", texts[path]),
                not re.search(rf"\b{package}\b", texts[path]),
            ),
        )
    )
