"""Pages about judging: what judges each requirement, every check and rule, and the kill matrix."""

import html
import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import NamedTuple

from splatbus_conformance.checks.registry import Judge, bound, exclusions, judges
from splatbus_schemas import requirements

from .markdown import table

PEERS = ("client", "server")
COVERAGE = "conformance/COVERAGE.md"
CHECKS = "conformance/CHECKS.md"
KILL_MATRIX = "conformance/KILL_MATRIX.md"
FILTER = '<div class="row-filter" data-what="{}"></div>\n'
NONE, SIMULATED = "—", "Found by the simulation"
_MUTANT = re.compile(
    r"^\| (?P<breaks>[A-Z]{3}-\d+|—) \| (?P<name>[^|]*) \| (?P<does>[^|]*) \| (?P<check>[^|]*)"
    r" \| (?P<fate>[^|]*) \| (?P<reason>[^|]*) \|$",
    re.MULTILINE,
)
_MUTANTS = re.compile(r"(^## Mutants\n\n)((?:\|.*\n)+)", re.MULTILINE)
_JUDGE = {
    "L0": "by reading bytes that crossed the wire",
    "L1": "by taking part as a live peer",
    "L2": "through an adapter beside the client",
    "L3": "in memory",
}


class Judged(NamedTuple):
    """A check or rule, and what it judges."""

    judge: Judge
    peer: str
    requirement: str


def coverage(kill_matrix: str) -> str:
    """Which check or rule judges each requirement at which level, or why none does."""
    kills = killed(kill_matrix)
    page = (
        "# Coverage\n\n"
        "What judges each requirement, on a client and on a server, and at which "
        "[level of assurance](README.md#what-a-verdict-means): "
        + ", ".join(f"{_level(level)} {how}" for level, how in _JUDGE.items())
        + ". Where nothing does, the reason. *Mutants* are broken programs that are "
        "[killed](KILL_MATRIX.md) for that requirement.\n\n"
    )
    for peer in PEERS:
        page += (
            f"- **{peer.capitalize()}**: {len(bound(peer))} requirements bind it, "
            f"{len(judges(peer))} are judged, {len(exclusions(peer))} are not.\n"
        )
    page += "\n" + FILTER.format("requirements")
    for clause, ids in _by_clause(requirements("1.1")).items():
        page += f"\n## {clause}\n\n"
        page += table(
            ("id", "level", "judged by", "mutants"),
            (
                (
                    f'<span id="coverage-{name}"></span>{name}',
                    requirements("1.1")[name].level,
                    "<br>".join(_judged(name, p) for p in PEERS if name in bound(p)),
                    f'<a href="kill-matrix.html#kills-{name}">{kills[name]}</a>'
                    if kills.get(name)
                    else "",
                )
                for name in ids
            ),
        )
    return page


def checks() -> str:
    """Every check and rule: what it does, what it sees, and what it judges."""
    page = (
        "# Checks and rules\n\n"
        "A check plays a scenario with its testee; a rule reads bytes, live or in a recording. "
        "Their names stand in reports, and after `--select`.\n\n" + FILTER.format("checks")
    )
    found = _everything()
    seen: set[str] = set()
    for title, chosen in (
        ("Checks on clients", [j for j in found if j.judge.level != "L0" and j.peer == "client"]),
        ("Checks on servers", [j for j in found if j.judge.level != "L0" and j.peer == "server"]),
        ("Rules", [j for j in found if j.judge.level == "L0"]),
    ):
        page += f"\n## {title}\n\n"
        page += table(
            ("judges", "level", "what it does"),
            (_check_row(name, same, seen) for name, same in _by_name(chosen).items()),
        )
    return page


@cache
def check_names() -> frozenset[str]:
    """The name of every check and rule: each is an anchor of the page of checks."""
    return frozenset(each.judge.name for each in _everything())


def kill_matrix(text: str) -> str:
    """The kill matrix with its long table divided by clause, and an anchor for each requirement."""

    def divided(match: re.Match[str]) -> str:
        rows: dict[str, list[re.Match[str]]] = {}
        for row in _MUTANT.finditer(match[2]):
            rows.setdefault(row["breaks"], []).append(row)
        page = match[1] + FILTER.format("programs")
        for clause, ids in _by_clause(rows).items():
            page += f"\n### {SIMULATED if clause == NONE else clause}\n\n"
            page += table(
                ("breaks", "mutant", "check", "fate"),
                (_mutant_row(row, row is rows[name][0]) for name in ids for row in rows[name]),
            )
        return page

    return _MUTANTS.sub(divided, text)


def killed(kill_matrix: str) -> Mapping[str, int]:
    """How many mutants were killed for each requirement."""
    counts: dict[str, int] = {}
    for row in _MUTANT.finditer(kill_matrix):
        counts[row["breaks"]] = counts.get(row["breaks"], 0) + (row["fate"] == "killed")
    return counts


def _mutant_row(row: re.Match[str], first: bool) -> tuple[str, ...]:
    anchor = f'<span id="kills-{row["breaks"]}"></span>' if first and row["breaks"] != NONE else ""
    why = f"{row['check']}<br>{row['reason']}"
    return f"{anchor}{row['breaks']}", f"{row['name']}<br>{row['does']}", why, row["fate"]


def _judged(name: str, peer: str) -> str:
    if name in exclusions(peer):
        return f"{peer} not judged: {html.escape(exclusions(peer)[name].reason)}"
    return "<br>".join(f"{peer} {_level(j.level)} `{j.name}`" for j in judges(peer)[name])


def _level(level: str) -> str:
    return f'<span class="assurance">{level}</span>'


def _everything() -> list[Judged]:
    return [
        Judged(judge, peer, name)
        for peer in PEERS
        for name, found in judges(peer).items()
        for judge in found
    ]


def _by_name(found: Iterable[Judged]) -> dict[str, list[Judged]]:
    names: dict[str, list[Judged]] = {}
    for each in sorted(found, key=lambda each: each.judge.name):
        names.setdefault(each.judge.name, []).append(each)
    return names


def _check_row(name: str, same: list[Judged], seen: set[str]) -> tuple[str, ...]:
    anchor = "" if name in seen else f'<span id="{name}"></span>'
    seen.add(name)
    judge = same[0].judge
    ids = ", ".join(dict.fromkeys(each.requirement for each in same))
    return ids, _level(judge.level), f"{anchor}`{name}`<br>{judge.what}"


def _by_clause(ids: Iterable[str]) -> dict[str, list[str]]:
    clauses: dict[str, list[str]] = {}
    for name in sorted(ids, key=lambda name: int(name.partition("-")[2] or 0)):
        clauses.setdefault(name.partition("-")[0], []).append(name)
    return dict(sorted(clauses.items()))
