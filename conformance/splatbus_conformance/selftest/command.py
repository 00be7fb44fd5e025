"""`splatbus-conformance selftest`."""

import argparse
import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.text import Text

from splatbus_conformance.data import read_json
from splatbus_conformance.selection import did_you_mean
from splatbus_conformance.selftest import judge, kill_matrix
from splatbus_conformance.selftest.judge import GOOD, REFERENCE, SpecimenResult
from splatbus_conformance.selftest.mutant import Variation
from splatbus_conformance.selftest.processes import harnesses
from splatbus_conformance.selftest.processes.spare import LOOK_SECONDS, Spare
from splatbus_conformance.selftest.registry import groups, mutants, variations
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING, EXIT_USAGE

CORES = os.cpu_count() or 1
WHOLE, SELECTED, MORE = 7 * CORES, 4 * CORES, 8 * CORES
"""At a time: runs of all checks; beside them runs of one or two, which are over sooner; and of
these so many more while the machine has time."""
Judging = Callable[[], SpecimenResult]


def selftest(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the reference pair, the variations and the mutants; 1 unless all is as it must be."""
    wanted = [name for name in arguments.only.split(",") if name]
    specimens = dict(every_specimen(arguments.profile))
    if unknown := [name for name in wanted if name not in specimens]:
        hint = did_you_mean(unknown[0], {name: name for name in specimens})
        out.print(
            f"splatbus-conformance: --only {','.join(unknown)}: there is no such specimen; {hint}"
            f"conformance/KILL_MATRIX.md names all {len(specimens)}",
            markup=False,
        )
        return EXIT_USAGE
    harnesses.PRELOADED.append("splatbus_conformance.selftest.preload")
    in_a_group = {name for group in groups() for name in group.members}
    usual = [name for name in specimens if name not in in_a_group]
    rows = {row.name: row for row in run({name: specimens[name] for name in wanted or usual}, out)}
    for group in groups():
        if row := rows.pop(group.name, None):
            rows |= {row.name: row for row in members(group, row, specimens, out)}
    in_order = [rows[name] for name in specimens if name in rows]
    if arguments.json:
        kill_matrix.save(in_order, Path(arguments.json))
    for row in in_order:
        if row.fate not in GOOD:
            out.print(f"\n{row.fate.upper()}  {row.name}: {row.does}", markup=False)
            if row.kind == "mutant":
                wanted_ = f"{row.requirement} by {row.check}, with the code {row.code}"
                out.print(f"  should fail  {wanted_}", markup=False)
            out.print(f"  seen         {row.seen or 'nothing'}", markup=False)
    out.print(f"\n{kill_matrix.sentence(in_order)}", markup=False)
    good = all(row.fate in GOOD for row in in_order)
    return EXIT_CONFORMING if good else EXIT_NOT_CONFORMING


def every_specimen(profile: str) -> Iterator[tuple[str, Judging]]:
    """The name of each specimen, and how to judge it: variations by this profile."""
    for name in REFERENCE:
        yield name, lambda it=name: judge.judge_reference(it)  # type: ignore[misc]
    for variation in (*groups(), *variations()):
        yield variation.name, lambda it=variation: judge.judge_variation(it, profile)  # type: ignore[misc]
    for mutant in mutants():
        yield mutant.name, lambda it=mutant: judge.judge_mutant(it)  # type: ignore[misc]


def run(chosen: dict[str, Judging], out: Console) -> Iterator[SpecimenResult]:
    """Judge specimens, some at a time, and say what became of each.

    The long ones come first, and before them those that nobody has measured.
    """
    seconds: dict[str, float] = read_json("durations.json")["specimens"]
    in_order = sorted(chosen, key=lambda name: -seconds.get(name, math.inf))
    selected = {mutant.name for mutant in mutants()}
    left = {kind: [it for it in in_order if (it in selected) is kind] for kind in (False, True)}
    running: dict[Future[SpecimenResult], bool] = {}
    spare, done = Spare(MORE), 0
    pool = ThreadPoolExecutor(WHOLE + SELECTED + MORE)
    try:
        with out.status(f"{len(chosen)} specimens"):
            while done < len(chosen):
                for kind, most in ((False, WHOLE), (True, SELECTED + spare.now())):
                    while left[kind] and list(running.values()).count(kind) < most:
                        running[pool.submit(chosen[left[kind].pop(0)])] = kind
                for future in wait(running, LOOK_SECONDS, FIRST_COMPLETED).done:
                    del running[future]
                    row, done = future.result(), done + 1
                    out.print(progress(row, done, len(chosen)), no_wrap=True, overflow="ellipsis")
                    yield row
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        harnesses.stop_all()
        pool.shutdown()


def members(
    group: Variation, row: SpecimenResult, specimens: dict[str, Judging], out: Console
) -> Iterator[SpecimenResult]:
    """What became of those whose liberties were taken at once: what became of all, or if that was
    not as it must be, of each by itself, which names the culprit; where none is, all are together.
    """
    known = {it.name: it for it in variations()}
    if row.fate in GOOD:
        for it in (known[name] for name in group.members):
            own = tuple(cell for cell in row.cells if cell.requirement in it.warns)
            yield replace(row, name=it.name, does=it.does, cells=own)
        return
    out.print(f"{group.name}: {row.fate}; each of its liberties by itself", markup=False)
    alone = list(run({name: specimens[name] for name in group.members}, out))
    yield from alone
    if all(it.fate in GOOD for it in alone):
        yield row


def progress(row: SpecimenResult, done: int, total: int) -> Text:
    """One line on one specimen."""
    line = Text(f"{done:4}/{total}  {row.requirement or row.kind:<9} ")
    line.append(f"{row.fate:<19}", "green" if row.fate in GOOD else "bold red")
    line.append(f"  {row.name}  ")
    line.append(f"{row.seconds:.1f} s", "dim")
    return line
