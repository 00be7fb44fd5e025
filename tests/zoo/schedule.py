"""Who is judged, some at a time, and what became of each."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial

from splatbus_conformance.images.memory.cuda_stand_in.building import NotAvailable, library_folder
from splatbus_conformance.selection import did_you_mean
from splatbus_schemas.requirements import requirements

from tests.durations import Durations
from tests.spare import LOOK_SECONDS, Spare
from tests.zoo.homes import Judge
from tests.zoo.judge import GOOD, SpecimenResult, judge
from tests.zoo.mutant import Kind, Specimen
from tests.zoo.processes import harnesses
from tests.zoo.registry import HAS_CUDA, groups, mutants, specimens

CORES = os.cpu_count() or 1
WHOLE, SELECTED, MORE = 7 * CORES, 5 * CORES, 12 * CORES
"""At a time: runs of all checks; beside them runs of one or two, which are over sooner; and of
these so many more while the machine has time."""
Judging = Callable[[Specimen], SpecimenResult]
Tell = Callable[[SpecimenResult], None]


def named() -> dict[str, Specimen]:
    """Every specimen, by its name."""
    return {it.name: it for it in specimens()}


def unknown(wanted: Sequence[str]) -> str:
    """What is wrong with these names, if one is nobody's."""
    known = named()
    strange = [name for name in wanted if name not in known]
    if not strange:
        return ""
    hint = did_you_mean(strange[0], {name: name for name in known})
    told = f"--only {','.join(strange)}: there is no such specimen; {hint}"
    return f"{told}conformance/KILL_MATRIX.md names all {len(known)}"


def usual(requirement: str = "") -> tuple[list[str], str]:
    """Whom a run judges that wants nobody in particular: liberties of a group are taken at once.
    Of mutants those alone that break a requirement, if one is given.

    And why nobody is among them whose images are in memory of a GPU, if nobody is.
    """
    left = {name for group in groups() for name in group.members}
    why = "" if HAS_CUDA else "cuda-bindings is not installed"
    try:
        library_folder()
    except NotAvailable as error:
        why = str(error)
        left |= {it.name for it in specimens() if it.home.judge is Judge.WITH_CUDA}
    if requirement:
        bound = requirements("1.1")[requirement].binds
        left |= {it.name for it in specimens() if it.side not in bound}
        left |= {it.name for it in mutants() if it.requirement != requirement}
    return [name for name in named() if name not in left], why


def judge_all(
    wanted: Sequence[str], profile: str, requirement: str, tell: Tell
) -> list[SpecimenResult]:
    """Judge these, variations by this profile, by all checks if no requirement is given; and tell
    of each.
    """
    known, judging = named(), partial(judge, profile=profile, requirement=requirement)
    harnesses.PRELOADED.append("tests.zoo.preload")
    rows = {row.name: row for row in run([known[name] for name in wanted], judging, tell)}
    for group in groups():
        if row := rows.pop(group.name, None):
            rows |= {row.name: row for row in members(group, row, judging, tell)}
    return [rows[name] for name in known if name in rows]


def run(chosen: Sequence[Specimen], judging: Judging, tell: Tell) -> Iterator[SpecimenResult]:
    """Judge specimens, some at a time, and tell what became of each.

    The long ones come first, and before them those that nobody has measured.
    """
    durations = Durations("specimens")
    left: dict[bool, list[Specimen]] = {False: [], True: []}
    for it in sorted(chosen, key=lambda it: -durations.of(it.name)):
        left[it.kind is Kind.MUTANT].append(it)
    running: dict[Future[SpecimenResult], bool] = {}
    spare, done = Spare(MORE), 0
    pool = ThreadPoolExecutor(WHOLE + SELECTED + MORE)
    try:
        while done < len(chosen):
            for kind, most in ((False, WHOLE), (True, SELECTED + spare.now())):
                while left[kind] and list(running.values()).count(kind) < most:
                    running[pool.submit(judging, left[kind].pop(0))] = kind
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
    group: Specimen, row: SpecimenResult, judging: Judging, tell: Tell
) -> Iterator[SpecimenResult]:
    """What became of those whose liberties were taken at once: what became of all, or if that was
    not as it must be, of each by itself, which names the culprit; where none is, all are together.
    """
    known = named()
    each = [known[name] for name in group.members]
    if row.fate in GOOD:
        for it in each:
            own = tuple(cell for cell in row.cells if cell.requirement in it.warns)
            yield replace(row, specimen=it, cells=own)
        return
    alone = list(run(each, judging, tell))
    yield from alone
    if all(it.fate in GOOD for it in alone):
        yield row
