"""`list` and `explain`: the requirements, and how each is judged."""

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from splatbus_schemas.requirements import requirements

from splatbus_conformance.checks.registry import bound, exclusions, judges
from splatbus_conformance.reports.terminal import words
from splatbus_conformance.selection import did_you_mean

PEERS = ("client", "server")
MOST_COLUMNS = 100
"""Of an explanation: longer lines are hard to read."""


def print_list(out: Console, peers: tuple[str, ...]) -> None:
    """One line for each requirement of each peer, and a count of what is judged."""
    for peer in peers:
        table = Table(box=None, pad_edge=False, header_style="bold")
        for heading in ("id", "level", "judged at", "by"):
            table.add_column(heading, no_wrap=heading != "by")
        judged, excluded = judges(peer), exclusions(peer)
        for requirement in bound(peer).values():
            by = judged.get(requirement.id, [])
            if by:
                levels = "+".join(sorted({judge.level for judge in by}))
                table.add_row(
                    requirement.id,
                    requirement.level,
                    levels,
                    ", ".join(words(judge.name) for judge in by),
                )
            else:
                reason = excluded[requirement.id].reason
                table.add_row(requirement.id, requirement.level, "–", Text(reason, "dim"))
        musts = [r for r in bound(peer).values() if r.level.startswith("MUST")]
        count = sum(r.id in judged for r in musts)
        told = f": {count} of {len(musts)} MUSTs are judged\n"
        out.print(Text.assemble("\n", (peer, "bold"), told))
        out.print(table)


def print_explanation(out: Console, name: str) -> bool:
    """Everything that is known of one requirement; False if there is none of this name."""
    requirement = requirements("1.1").get(name.upper())
    if requirement is None:
        out.print(f"{name}: {_what_there_is(name.upper())}")
        return False
    title = (requirement.id, "bold"), f"  {requirement.level}  ", (requirement.chapter, "dim")
    out.print(Text.assemble("\n", *title, "\n"))
    grid = Table.grid(padding=(0, 2))
    grid.add_row("sentence", Text(requirement.sentence))
    if requirement.why:
        grid.add_row("why", Text(requirement.why))
    grid.add_row("acceptable", ", ".join(requirement.acceptable))
    for peer in requirement.binds:
        for judge in judges(peer).get(requirement.id, []):
            grid.add_row(
                peer, Text.assemble((words(judge.name), "bold"), f", judged at {judge.level}")
            )
            grid.add_row("", Text(judge.what, "dim"))
        if why := exclusions(peer).get(requirement.id):
            level = why.visible_at
            where = "no level shows it" if level == "none" else f"visible at {level}"
            grid.add_row(peer, f"not judged: {where}")
            grid.add_row("", Text(why.reason, "dim"))
    out.print(Padding(grid, (0, 0, 1, 2), expand=False), width=min(out.width, MOST_COLUMNS))
    return True


def _what_there_is(name: str) -> str:
    known = {it: it for it in requirements("1.1")}
    families: dict[str, list[str]] = {}
    for each in known:
        families.setdefault(each.partition("-")[0], []).append(each)
    if name in families:
        return f"a clause, with {', '.join(families[name])}"
    hint = did_you_mean(name, known)
    return f"no such requirement; {hint}the clauses are {', '.join(sorted(families))}"
