"""The kill matrix: which check killed which mutant, and why; as JSON and as Markdown."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from tests.zoo.judge import GOOD, Cell, Fate, SpecimenResult
from tests.zoo.mutant import Kind
from tests.zoo.registry import specimens

PAGE = Path(__file__).parents[2] / "conformance" / "KILL_MATRIX.md"
RIGHT = {Kind.REFERENCE: Fate.PASSED, Kind.VARIATION: Fate.ALLOWED, Kind.MUTANT: Fate.KILLED}
LAST = "~"
HEAD = """\
# Kill matrix

Written by `python -m tests renew`: what has to become of each. `python -m tests zoo`, a step of the
test command, runs the harness on all of them, and fails by one that is not as it stands here.

There are three kinds of program: the reference pair, which has to pass; variations of
them, which are unusual and conform, and have to pass too; and mutants of them, each of which breaks
one requirement and has to fail for it, by the check and with the code that are named here. Those
at the end are for the simulation of the pair, which has to find them by an invariant.

"""


def as_declared() -> str:
    """The page, if what becomes of each specimen is what was declared of it."""
    return markdown(
        [
            SpecimenResult(
                it, RIGHT[it.kind], tuple(Cell(each, "", "warn", "") for each in it.warns)
            )
            for it in specimens()
            if not it.members
        ]
    )


def sentence(rows: Sequence[SpecimenResult]) -> str:
    """What came of it, in one line."""
    mutants, others = parted(rows)
    killed = sum(row.fate is Fate.KILLED for row in mutants)
    passed = sum(row.fate in GOOD for row in others)
    found = {row.specimen.requirement for row in mutants if row.fate is Fate.KILLED}
    broken = len(found - {""})
    return (
        f"{killed} of {len(mutants)} mutants killed, by the check and with the code that they "
        f"name, over {broken} requirements; {passed} of {len(others)} conforming programs passed"
    )


def parted(rows: Iterable[SpecimenResult]) -> tuple[list[SpecimenResult], list[SpecimenResult]]:
    """Those of mutants, and of what conforms."""
    found: tuple[list[SpecimenResult], list[SpecimenResult]] = [], []
    for row in rows:
        found[row.specimen.kind is not Kind.MUTANT].append(row)
    return found


def complaint(row: SpecimenResult) -> str:
    """What is not as it must be, in some lines."""
    it = row.specimen
    lines = [f"\n{row.fate.upper()}  {row.name}: {it.does}"]
    if row.specimen.kind is Kind.MUTANT:
        lines.append(f"  should fail  {it.requirement} by {it.check}, with the code {it.code}")
    return "\n".join([*lines, f"  seen         {row.seen or 'nothing'}"])


def save(rows: Sequence[SpecimenResult], path: Path) -> None:
    """Write the matrix to `path` as JSON, and beside it as Markdown."""
    matrix = {"format": "1", "summary": sentence(rows), "rows": [row.as_json() for row in rows]}
    path.write_text(json.dumps(matrix, indent=1, ensure_ascii=False) + "\n", "utf-8")
    path.with_suffix(".md").write_text(markdown(rows), "utf-8")


def markdown(rows: Sequence[SpecimenResult]) -> str:
    """The matrix as a page for people."""
    mutants, others = parted(rows)
    mutants.sort(key=lambda row: row.specimen.requirement or LAST)
    page = f"{HEAD}**{sentence(rows)}.**\n\n## Mutants\n\n"
    page += _table(
        ("breaks", "mutant", "what it does", "check", "fate", "with the code"),
        (
            (it.requirement or "—", f"`{it.name}`", it.does, f"`{it.check}`", _bold(row), code)
            for row in mutants
            for it in [row.specimen]
            for code in [f"`{it.code}`" if it.code else "—"]
        ),
    )
    page += "\n## Conforming programs\n\n"
    page += _table(
        ("program", "what it does", "fate", "warned of"),
        ((f"`{r.name}`", r.specimen.does, _bold(r), _warned(r)) for r in others),
    )
    return page


def _bold(row: SpecimenResult) -> str:
    return row.fate if row.fate in GOOD else f"**{row.fate}**"


def _warned(row: SpecimenResult) -> str:
    return ", ".join(sorted({cell.requirement for cell in row.cells})) or "—"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '∣') for cell in line)} |\n" for line in lines)
