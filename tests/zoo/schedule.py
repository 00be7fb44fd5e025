"""Who is judged, some at a time, and what became of each."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace

from splatbus_conformance.selection import did_you_mean

from tests.durations import Durations
from tests.spare import LOOK_SECONDS, Spare
from tests.zoo import judge
from tests.zoo.judge import GOOD, REFERENCE, SpecimenResult
from tests.zoo.mutant import Variation
from tests.zoo.processes import harnesses
from tests.zoo.registry import groups, mutants, variations

CORES = os.cpu_count() or 1
WHOLE, SELECTED, MORE = 7 * CORES, 4 * CORES, 8 * CORES
"""At a time: runs of all checks; beside them runs of one or two, which are over sooner; and of
these so many more while the machine has time."""
Judging = Callable[[], SpecimenResult]
Tell = Callable[[SpecimenResult], None]


def unknown(wanted: Sequence[str]) -> str:
    """What is wrong with these names, if one is nobody's."""
    specimens = {name: name for name, _ in every_specimen("brief")}
    strange = [name for name in wanted if name not in specimens]
    if not strange:
        return ""
    hint = did_you_mean(strange[0], specimens)
    told = f"--only {','.join(strange)}: there is no such specimen; {hint}"
    return f"{told}conformance/KILL_MATRIX.md names all {len(specimens)}"


def judge_all(wanted: Sequence[str], profile: str, tell: Tell) -> list[SpecimenResult]:
    """Judge these, or the reference pair, the variations and the mutants; tell of each."""
    specimens = dict(every_specimen(profile))
    harnesses.PRELOADED.append("tests.zoo.preload")
    in_a_group = {name for group in groups() for name in group.members}
    usual = [name for name in specimens if name not in in_a_group]
    rows = {row.name: row for row in run({it: specimens[it] for it in wanted or usual}, tell)}
    for group in groups():
        if row := rows.pop(group.name, None):
            rows |= {row.name: row for row in members(group, row, specimens, tell)}
    return [rows[name] for name in specimens if name in rows]


def every_specimen(profile: str) -> Iterator[tuple[str, Judging]]:
    """The name of each specimen, and how to judge it: variations by this profile."""
    for name in REFERENCE:
        yield name, lambda it=name: judge.judge_reference(it)  # type: ignore[misc]
    for variation in (*groups(), *variations()):
        yield variation.name, lambda it=variation: judge.judge_variation(it, profile)  # type: ignore[misc]
    for mutant in mutants():
        yield mutant.name, lambda it=mutant: judge.judge_mutant(it)  # type: ignore[misc]


def run(chosen: dict[str, Judging], tell: Tell) -> Iterator[SpecimenResult]:
    """Judge specimens, some at a time, and tell what became of each.

    The long ones come first, and before them those that nobody has measured.
    """
    durations = Durations("specimens")
    in_order = sorted(chosen, key=lambda name: -durations.of(name))
    selected = {mutant.name for mutant in mutants()}
    left = {kind: [it for it in in_order if (it in selected) is kind] for kind in (False, True)}
    running: dict[Future[SpecimenResult], bool] = {}
    spare, done = Spare(MORE), 0
    pool = ThreadPoolExecutor(WHOLE + SELECTED + MORE)
    try:
        while done < len(chosen):
            for kind, most in ((False, WHOLE), (True, SELECTED + spare.now())):
                while left[kind] and list(running.values()).count(kind) < most:
                    running[pool.submit(chosen[left[kind].pop(0)])] = kind
            for future in wait(running, LOOK_SECONDS, FIRST_COMPLETED).done:
                del running[future]
                row, done = future.result(), done + 1
                tell(row)
                yield row
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        harnesses.stop_all()
        pool.shutdown()


def members(
    group: Variation, row: SpecimenResult, specimens: dict[str, Judging], tell: Tell
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
    alone = list(run({name: specimens[name] for name in group.members}, tell))
    yield from alone
    if all(it.fate in GOOD for it in alone):
        yield row
