"""Run the harness, as a process, on one specimen, and say what came of it."""

import json
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any

from splatbus_conformance.plan import Side
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    Verdict,
)

from tests.zoo import mutants
from tests.zoo.faults.patching import Patch
from tests.zoo.homes import Judge
from tests.zoo.mutant import RULE, TRAFFIC, Kind, Specimen
from tests.zoo.processes import harnesses
from tests.zoo.registry import REFERENCES, specimen_named

TOLD = {"reference-server-that-wants-a-token": {"SPLATBUS_TOKEN": "a token"}}
"""What the harness and its testee find in their environment."""
SILENT_SECONDS = 400.0
"""For so long a harness that still runs may say nothing."""
SESSIONS = 400
"""Of the simulation, which finds most in the first."""
OPTIONS = {Judge.WITH_CUDA: ("--stand-in-cuda",)}
SELECTED = {Judge.WITH_CUDA: "L3,POS"}
"""Of the checks of what conforms; all where nothing is said."""
PROGRAMS: dict[Side, str] = {"client": "splatbus_viewer", "server": "splatbus_renderer"}
"""The references that a person starts."""
USUAL: dict[Side, str] = {"client": "view", "server": "--quiet --size 64x48"}
"""What a specimen is told on its command line."""
OUTPUT_CHARS = 600


class Fate(StrEnum):
    """What became of a specimen; the first three are as they should be."""

    PASSED = "passed"
    """The reference conforms."""
    KILLED = "killed"
    """The named check found the mutant out, by the code that it names."""
    ALLOWED = "survived, as it must"
    """The variation conforms."""
    SURVIVED = "survived"
    """No check of the broken requirement failed: they are too weak."""
    MISTAKEN = "killed for another reason"
    """The requirement failed, but by another check or for another reason than was declared."""
    CONDEMNED = "condemned wrongly"
    """A conforming program failed: a check is too strict."""
    NO_VERDICT = "no verdict"
    """The harness came to none; its last words are in `note`."""


GOOD = frozenset({Fate.PASSED, Fate.KILLED, Fate.ALLOWED})


@dataclass(frozen=True)
class Cell:
    """One check's verdict on one specimen."""

    requirement: str
    check: str
    verdict: str
    text: str
    code: str = ""

    @property
    def condemns(self) -> bool:
        """The verdict is one that a testee gets for breaking a requirement."""
        return self.verdict in (Verdict.FAIL, Verdict.WARN)


@dataclass(frozen=True)
class SpecimenResult:
    """What the harness said of one specimen."""

    specimen: Specimen
    fate: Fate
    cells: tuple[Cell, ...] = ()
    """Those that condemn it, and of a mutant those of what it breaks."""
    seconds: float = 0.0
    note: str = ""
    checks: Mapping[str, float] = field(default_factory=dict)
    """Of a reference: the seconds of each check that delivered something."""

    @property
    def name(self) -> str:
        """The specimen's."""
        return self.specimen.name

    @property
    def seen(self) -> str:
        """What was found out: the verdict that killed a mutant, or what else there is to say."""
        it = self.specimen
        if it.kind is Kind.MUTANT:
            told = [c for c in self.cells if c.requirement == it.requirement]
            told.sort(key=lambda cell: (not cell.condemns, cell.check != it.check))
            return self.note or "; ".join(f"{c.verdict} {c.code}: {c.text}" for c in told[:2])
        return self.note or "; ".join(f"{c.requirement}: {c.text}" for c in self.cells)

    def as_json(self) -> dict[str, Any]:
        """For the stored matrix."""
        said = ("name", "kind", "does", "requirement", "check", "code")
        told = asdict(self) | {name: getattr(self.specimen, name) for name in said}
        del told["specimen"]
        return {**told, "seconds": round(self.seconds, 1)}


def judge(specimen: Specimen, profile: str = "brief", requirement: str = "") -> SpecimenResult:
    """What becomes of it: of variations by this profile; of what conforms by the checks of a
    requirement alone, if one is given.
    """
    began = time.monotonic()
    conforming = partial(judge_conforming, profile, requirement)
    by = judge_mutant if specimen.kind is Kind.MUTANT else conforming
    return replace(by(specimen), seconds=time.monotonic() - began)


def judge_mutant(mutant: Specimen) -> SpecimenResult:
    """Ask the judge who has to find it out."""
    ask = by_simulation if mutant.home.judge is Judge.SIMULATION else by_harness
    cells, last_words = ask(mutant)
    fate, note = fate_of(mutant, cells or []), ""
    failed = any(cell.verdict == Verdict.ERROR for cell in cells or ())
    if not cells or (fate is Fate.SURVIVED and failed):
        fate, note = Fate.NO_VERDICT, last_words
    told = tuple(c for c in cells or () if c.requirement == mutant.requirement or c.condemns)
    return SpecimenResult(mutant, fate, told, note=note)


def by_harness(mutant: Specimen) -> tuple[list[Cell] | None, str]:
    """Run the check that has to find a mutant out; for a rule, those that make the traffic."""
    by_rule = mutant.check == RULE
    select = f"{mutant.through},{mutant.requirement}" if by_rule else mutant.check
    report, _, last_words = run_harness(mutant, select, more=OPTIONS.get(mutant.home.judge, ()))
    return None if report is None else cells_of(report), last_words


def by_simulation(mutant: Specimen) -> tuple[list[Cell] | None, str]:
    """Play sessions in a process of their own, until an invariant does not hold."""
    status, told = harnesses.run([mutant.name], SILENT_SECONDS, {}, play_all)
    invariant, _, text = told.partition(":")
    found = [Cell(mutant.requirement, invariant, Verdict.FAIL, text[:OUTPUT_CHARS].strip())]
    if status == EXIT_CONFORMING:
        found = []
    return None if status is None else found, told[-OUTPUT_CHARS:]


def play_all(names: list[str]) -> int:
    """Play sessions of a pair that is altered, and print which invariant does not hold."""
    from tests.simulation.machine.world import BrokenError
    from tests.simulation.session import play

    specimen_named(names[0]).alter(Patch())  # type: ignore[union-attr]
    for seed in range(SESSIONS):
        try:
            play(seed)
        except BrokenError as error:
            print(error)
            return EXIT_NOT_CONFORMING
    return EXIT_CONFORMING


def fate_of(mutant: Specimen, cells: list[Cell]) -> Fate:
    """What the verdicts make of a mutant."""
    against = [c for c in cells if c.requirement == mutant.requirement and c.condemns]
    if any(c.check == mutant.check and mutant.code == c.code for c in against):
        return Fate.KILLED
    return Fate.MISTAKEN if against else Fate.SURVIVED


def judge_conforming(profile: str, requirement: str, it: Specimen) -> SpecimenResult:
    """Run every check on what has to pass, or those of a requirement."""
    reference = it.kind is Kind.REFERENCE
    if reference:
        profile = "brief" if it.name in TOLD else "quick"
    select = SELECTED.get(it.home.judge, "")
    if requirement:
        select = f"{requirement},{TRAFFIC[it.side]}"
    must_warn = {name for name in it.warns if not requirement or name in select.split(",")}
    more = OPTIONS.get(it.home.judge, ())
    report, status, last_words = run_harness(it, select, more=("--profile", profile, *more))
    cells = [c for c in cells_of(report) if c.condemns or c.verdict == Verdict.ERROR]
    warned = {c.requirement for c in cells if c.verdict == Verdict.WARN}
    wrong = any(c.verdict != Verdict.WARN for c in cells)
    # Of one requirement there may be nothing to see.
    least = EXIT_NO_VERDICT if requirement else EXIT_CONFORMING
    if report is None:
        fate, note = Fate.NO_VERDICT, last_words
    elif status in (EXIT_CONFORMING, least) and warned == must_warn and not wrong:
        fate, note = Fate.PASSED if reference else Fate.ALLOWED, ""
    elif warned >= must_warn:
        fate, note = Fate.CONDEMNED, ""
    else:
        fate, note = Fate.SURVIVED, f"no warning for {', '.join(sorted(must_warn - warned))}"
    seconds = {
        result["check"]: result["seconds"]
        for requirement in (report or {}).get("requirements", [])
        for result in requirement["results"]
        if reference and result["delivered"]
    }
    return SpecimenResult(it, fate, tuple(cells), note=note, checks=seconds)


def cells_of(report: dict[str, Any] | None) -> list[Cell]:
    """Every verdict in a report of the harness."""
    return [
        Cell(requirement["id"], result["check"], result["verdict"], result["text"], result["code"])
        for requirement in (report or {}).get("requirements", [])
        for result in requirement["results"]
    ]


def run_harness(
    specimen: Specimen, select: str, more: Sequence[str] = ()
) -> tuple[dict[str, Any] | None, int | None, str]:
    """Judge a specimen by `splatbus-conformance SIDE --launch --select`; by `--adapter` where there
    are axes, in which its adapter gives and takes poses.

    Returns its JSON report, or None if there is none, its exit status, or None if it had to be
    ended, and the last that it printed.
    """
    name, side, axes = specimen.name, specimen.side, specimen.axes
    reference = "splatbus_viewer.adapter" if axes else PROGRAMS[side]
    module = reference if specimen in REFERENCES else f"{mutants.__name__} {name}"
    how, arguments = ("--adapter", f"--axes {axes}") if axes else ("--launch", USUAL[side])
    testee = f'"{sys.executable}" -m {module} {arguments}'
    with tempfile.TemporaryDirectory(prefix="splatbus-zoo-") as folder:
        path = Path(folder, "report.json")
        line = ["--plain", side, how, testee, "--select", select, "--json", str(path)]
        line += ["--parallel", "1", "--shrink", "0", "--scripts", folder, *more]
        status, output = harnesses.run(line, SILENT_SECONDS, TOLD.get(name, {}))
        report = json.loads(path.read_text("utf-8")) if path.exists() else None
    return report, status, output[-OUTPUT_CHARS:].strip()
