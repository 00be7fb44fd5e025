"""`splatbus-conformance selftest`."""

import argparse
import itertools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.text import Text

from splatbus_conformance.plan import SIDES
from splatbus_conformance.selection import did_you_mean
from splatbus_conformance.selftest import judge, kill_matrix
from splatbus_conformance.selftest.judge import GOOD, REFERENCE, SpecimenResult
from splatbus_conformance.selftest.processes import harnesses
from splatbus_conformance.selftest.registry import mutants, variations
from splatbus_conformance.selftest.seeds import judge_seeds
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING, EXIT_USAGE

WORKERS = 10
"""Most of a run is waiting: ten do not disturb each other on two cores yet."""

MOST_UNHURRIED = 5

Trial = Callable[[], SpecimenResult]


def selftest(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the reference pair, the variations and the mutants; 1 unless all is as it must be."""
    if arguments.seeds:
        return judge_seeds(arguments.seeds, out)
    wanted = [name for name in arguments.only.split(",") if name]
    trials_ = dict(every_trial(arguments.profile))
    if unknown := [name for name in wanted if name not in trials_]:
        hint = did_you_mean(unknown[0], {name: name for name in trials_})
        out.print(
            f"splatbus-conformance: --only {','.join(unknown)}: there is no such specimen; {hint}"
            f"conformance/KILL_MATRIX.md names all {len(trials_)}",
            markup=False,
        )
        return EXIT_USAGE
    chosen = {name: trials_[name] for name in wanted} if wanted else trials_
    rows = {row.name: row for row in run(chosen, out)}
    rows |= {row.name: row for row in unhurried(chosen, rows, out)}
    in_order = [rows[name] for name in chosen]
    if arguments.json:
        kill_matrix.save(in_order, Path(arguments.json))
    for row in in_order:
        if row.fate not in GOOD:
            out.print(f"\n{row.fate.upper()}  {row.name}: {row.does}", markup=False)
            if row.kind == "mutant":
                wanted_ = f"{row.requirement} by {row.check}, with the words “{row.reason}”"
                out.print(f"  should fail  {wanted_}", markup=False)
            out.print(f"  seen         {row.seen or 'nothing'}", markup=False)
    out.print(f"\n{kill_matrix.sentence(in_order)}", markup=False)
    good = all(row.fate in GOOD for row in in_order)
    return EXIT_CONFORMING if good else EXIT_NOT_CONFORMING


def every_trial(profile: str) -> Iterator[tuple[str, Trial]]:
    """The name of each specimen, and how to judge it; the long ones first.

    Variations are judged by this profile, clients and servers in turn: a client waits for most of
    its trial, and a server computes.
    """
    for name in REFERENCE:
        yield name, lambda it=name: judge.judge_reference(it)  # type: ignore[misc]
    sides = [[it for it in variations() if it.side == side] for side in SIDES]
    in_turn = itertools.chain.from_iterable(itertools.zip_longest(*sides))
    for variation in filter(None, in_turn):
        yield variation.name, lambda it=variation: judge.judge_variation(it, profile)  # type: ignore[misc]
    for mutant in mutants():
        yield mutant.name, lambda it=mutant: judge.judge_mutant(it)  # type: ignore[misc]


def run(chosen: dict[str, Trial], out: Console) -> Iterator[SpecimenResult]:
    """Judge specimens, some at a time, and say what became of each."""
    pool = ThreadPoolExecutor(WORKERS)
    try:
        running = [pool.submit(trial) for trial in chosen.values()]
        with out.status(f"{len(running)} specimens"):
            for done, future in enumerate(as_completed(running), 1):
                row = future.result()
                out.print(progress(row, done, len(running)), no_wrap=True, overflow="ellipsis")
                yield row
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        harnesses.stop_all()
        pool.shutdown()


def unhurried(
    chosen: dict[str, Trial], rows: dict[str, SpecimenResult], out: Console
) -> Iterator[SpecimenResult]:
    """Judge by itself what was not as it must be while others ran: it may have been short of time.

    Nothing of that is hidden: the summary names them. Many at once are no accident.
    """
    wrong = [name for name, row in rows.items() if row.fate not in GOOD]
    if len(rows) == 1 or len(wrong) > MOST_UNHURRIED:
        return
    for name in wrong:
        out.print(f"{name}: {rows[name].fate}; again, by itself", markup=False)
        for row in run({name: chosen[name]}, out):
            yield replace(row, again=True)


def progress(row: SpecimenResult, done: int, total: int) -> Text:
    """One line on one specimen."""
    line = Text(f"{done:4}/{total}  {row.requirement or row.kind:<9} ")
    line.append(f"{row.fate:<19}", "green" if row.fate in GOOD else "bold red")
    line.append(f"  {row.name}  ")
    line.append(f"{row.seconds:.1f} s", "dim")
    return line
