"""The command `compare`: stored reports beside each other."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from splatbus_conformance.cli.arguments import files_of
from splatbus_conformance.plan import Usage
from splatbus_conformance.reports.comparison import (
    Comparison,
    alike,
    circumstances,
    compared,
    markdown_comparison,
    told,
)
from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.markdown import VERDICTS
from splatbus_conformance.reports.files.stored import load
from splatbus_conformance.reports.terminal import STYLE
from splatbus_conformance.verdicts import EXIT_CONFORMING, Verdict


def compare(arguments: argparse.Namespace, out: Console) -> int:
    """Show stored reports beside each other. Raises Usage."""
    files = files_of(arguments)
    found = compared(stored([Path(each) for each in arguments.reports]))
    files.put(lambda name, _: made(name, found).encode())
    for each in found:
        show(each, out)
    return EXIT_CONFORMING


def made(name: str, found: Sequence[Comparison]) -> str:
    """One of the files that are written."""
    if name == "markdown":
        return markdown_comparison(found)
    from splatbus_conformance.reports.files.html.page import html_comparison  # imports for long

    return html_comparison(found)


def stored(named: Sequence[Path]) -> Iterator[tuple[str, Report]]:
    """The reports in these files, and in those of these folders, each called as its file."""
    paths: list[Path] = []
    for each in named:
        inside = sorted(each.glob("*.json")) if each.is_dir() else [each]
        if not inside:
            raise Usage(f"{each}: there is no report in this folder; --json writes one")
        paths += inside
    stems = [path.stem for path in paths]
    for path in paths:
        label = path.stem if stems.count(path.stem) == 1 else str(path)
        yield from ((label, report) for report in load(path))


def show(it: Comparison, out: Console) -> None:
    """On a terminal."""
    out.print(f"SplatBus {it.side}s, judged by splatbus-conformance {it.harness}")
    for each in it.columns:
        out.print(f"  {each.label}: {circumstances(each)}")
    for change in it.changes:
        for line in told(change):
            out.print(Text(f"  {line}", "bold"))
    table = Table("", *(each.label for each in it.columns), box=None, padding=(0, 2, 0, 0))
    for id, verdicts in it.rows.items():
        table.add_row(id, *(Text(VERDICTS[each], STYLE[Verdict(each)]) for each in verdicts))
    out.print(table)
    out.print(alike(it))
