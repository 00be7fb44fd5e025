"""Judge a mutant that was made by machine: by the harness, and by the tests."""

import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_conformance.plan import Side
from splatbus_conformance.run import running
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import EXIT_NO_VERDICT, Verdict

from tests.zoo.judge import Cell, cells_of, run_harness
from tests.zoo.machine import lines
from tests.zoo.machine.lines import Watched
from tests.zoo.machine.modules import Drawn
from tests.zoo.machine.specimens import CHANGED, MachineMade
from tests.zoo.machine.testing import ByTests, by_tests
from tests.zoo.processes import harnesses

RUN_SECONDS = 400.0
"""The longest that all checks may take; a watched reference takes several times its own."""
FIRST = 6
"""So many checks are run on each side before the others are."""
PARTNER = "unity"
"""Whose axes the client's adapter uses."""
BY_RULES = "L0"
TESTS = "tests"


class Phase(NamedTuple):
    """How a side is judged."""

    side: Side
    axes: str = ""
    token: bool = False
    command: str = ""
    """In place of the usual one, where it has no adapter."""

    @property
    def name(self) -> str:
        """In what is stored."""
        token = "with a token" * self.token
        return " ".join(filter(None, (self.side, self.axes, token, self.command)))

    @property
    def environment(self) -> dict[str, str]:
        """Of the harness and of the specimen."""
        return {"SPLATBUS_TOKEN": "a token that both are given"} if self.token else {}


PHASES = (
    Phase("server"),
    Phase("server", token=True),
    Phase("client", PARTNER),
    *(Phase("client", command=it) for it in ("view", "view --size 80x60", "telemetry")),
    *(Phase("client", axes) for axes in ("blender", "unreal", "opengl_camera")),
)
"""A later one of a side is for what no earlier one executes, or only while modules are read."""


class MutantFate(StrEnum):
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


@dataclass(frozen=True)
class Judged:
    """What came of one mutant."""

    name: str
    line: int
    before: str
    after: str
    fate: MutantFate
    tested: ByTests
    phase: str = ""
    """Of the harness, in which it was found."""
    check: str = ""
    """That ran then."""
    by: str = ""
    """What was found."""
    test: str = ""
    """The first that failed."""
    seconds: float = 0.0
    """Of the harness."""

    @property
    def function(self) -> str:
        """Where the change is."""
        return self.name.rsplit(":", 2)[0]

    def as_json(self) -> dict[str, Any]:
        """For the stored result: of what died, only what helps to kill others, or it again."""
        told = ("line", "before", "after", "by") if self.fate is MutantFate.KILLED else ()
        return {name: it for name, it in asdict(self).items() if it and name not in told}

    @classmethod
    def from_json(cls, members: dict[str, Any]) -> "Judged":
        """The reverse."""
        untold = {"line": 0, "before": "", "after": ""}
        fate, tested = MutantFate(members["fate"]), ByTests(members["tested"])
        return cls(**{**untold, **members, "fate": fate, "tested": tested})


class HarnessVerdict(NamedTuple):
    """What the harness found."""

    fate: MutantFate
    phase: str = ""
    check: str = ""
    by: str = ""


def judge(
    drawn: Drawn, watched: Mapping[str, Watched] | None, former: Mapping[str, Judged]
) -> Judged:
    """By the checks that execute what was changed, and by the tests; first by those by which others
    of the same function died.

    Where nobody watched, by every check, and by no test.
    """
    it = drawn.change
    alike = [other for other in former.values() if it.name.startswith(f"{other.function}:")]
    began = time.monotonic()
    opinion = by_harness(drawn, watched, alike)
    seconds = round(time.monotonic() - began, 1)
    tested, first = ByTests.UNKNOWN, ""
    if watched is not None:
        tested, first = by_tests(it, watched[TESTS], [other.test for other in alike])
    return Judged(
        *(it.name, it.line, it.before, it.after, opinion.fate, tested),
        *(opinion.phase, opinion.check, opinion.by, first, seconds),
    )


def by_harness(
    drawn: Drawn, watched: Mapping[str, Watched] | None, alike: Sequence[Judged]
) -> HarnessVerdict:
    """The worst that is found, one run after the other until one breaks a MUST."""
    found = [HarnessVerdict(MutantFate.UNTOUCHED)]
    unmet: set[Side] = set()
    for phase, checks in _plan(drawn, watched, alike):
        if phase.side in unmet:
            continue
        opinion = run(drawn.change.name, phase, checks)
        if opinion.fate is MutantFate.UNMET:
            unmet.add(phase.side)
            if phase.axes:  # what cannot speak through its adapter may do so by itself
                opinion = run(drawn.change.name, Phase(phase.side))
        if opinion.fate is MutantFate.KILLED:
            return opinion
        found.append(opinion)
    order = list(MutantFate)
    return min(found, key=lambda opinion: order.index(opinion.fate))


def _plan(
    drawn: Drawn, watched: Mapping[str, Watched] | None, alike: Sequence[Judged]
) -> Iterator[tuple[Phase, list[str]]]:
    """The runs to make, with the checks of each; all where there are none."""
    phases = [phase for phase in PHASES if phase.side in drawn.sides]
    deadly = {it.name: [other.check for other in alike if other.phase == it.name] for it in phases}
    if watched is None:
        formerly = [phase for phase in phases if deadly[phase.name]]
        yield from ((it, [check]) for it in formerly for check in deadly[it.name] if check)
        yield from ((it, []) for it in formerly or phases)
        return
    first: dict[Phase, list[str]] = {}
    then: dict[Phase, list[str]] = {}
    for phase in phases:
        checks = _in_order(watched[phase.name], drawn, deadly[phase.name])
        if not checks:
            continue
        if phase.side not in [it.side for it in then]:
            first[phase], then[phase] = checks[:FIRST], checks[FIRST:]
        elif phase.token or not drawn.change.name.split(":")[1]:
            # A token changes how a session begins, and what follows is as it is without one; what
            # is made while a module is read, as the axes of an engine, may be for this phase alone.
            first[phase] = checks[:FIRST]
    if len(first) == 1:  # there is nobody to be quick for
        first, then = {it: checks + then[it] for it, checks in first.items()}, {}
    in_turn = sorted(first, key=lambda phase: not deadly[phase.name])
    yield from ((it, first[it]) for it in in_turn)
    yield from ((it, then[it]) for it in in_turn if then.get(it))


def _in_order(watched: Watched, drawn: Drawn, deadly: Sequence[str]) -> list[str]:
    """The checks that can tell: those by which others died, then those that are about the module,
    for what they take.
    """
    change = drawn.change

    def rank(name: str) -> tuple[int, float]:
        devotion = watched.devotion(name, change.module)
        return -deadly.count(name), -devotion / (0.2 + watched.seconds[name])

    return sorted(watched.telling(change), key=rank)


def run(change: str, phase: Phase, checks: Sequence[str] = ()) -> HarnessVerdict:
    """What these checks find, in their order, or all."""
    made = MachineMade(CHANGED, phase.side, phase.axes, change)
    with tempfile.TemporaryDirectory(prefix="splatbus-machine-") as folder:
        now = lines.now_of(Path(folder, "machine"))
        lines.nobody_yet(now)
        report, status, last_words = run_harness(
            made,
            ",".join((BY_RULES, *checks) if checks else ()),
            RUN_SECONDS,
            ("--exitfirst",),
            phase.environment,
            partial(judging, str(now), checks),
            phase.command,
        )
        check = lines.told(now)
    cells = cells_of(report) + [
        Cell(it["requirement"], it["check"], it["verdict"], it["text"])
        for it in (report or {}).get("others", [])
    ]
    if report is None:
        return HarnessVerdict(MutantFate.NO_VERDICT, phase.name, check, last_words)
    unmet = status == EXIT_NO_VERDICT and any(cell.check == "run" for cell in cells)
    for verdict, fate in (
        (Verdict.FAIL, MutantFate.KILLED),
        (Verdict.ERROR, MutantFate.UNMET if unmet else MutantFate.CRASHED),
        (Verdict.WARN, MutantFate.WARNED),
    ):
        if told := [cell for cell in cells if cell.verdict == verdict]:
            it = told[0]
            by = "a rule" if it.check == RULE else it.check
            return HarnessVerdict(
                fate, phase.name, check, f"{it.requirement} {by}: {it.text}"[:300]
            )
    return HarnessVerdict(MutantFate.SURVIVED)


def judging(now: str, checks: Sequence[str], line: list[str]) -> int:
    """A harness that tells which check it runs, and runs them in this order."""
    lines.tell(now)
    if checks:
        places = {name: place for place, name in enumerate(checks)}
        running.in_order = lambda checks: sorted(checks, key=lambda it: places[it.name])
    return harnesses.judge(line)
