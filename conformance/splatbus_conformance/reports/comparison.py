"""Stored reports beside each other: what each testee keeps and breaks, and what has changed."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.markdown import VERDICTS, code, plain

NOT_KEPT = frozenset(("fail", "warn", "expected", "harness-error"))
UNSEEN = "skip"


class Column(NamedTuple):
    """What one report says."""

    label: str
    report: Report
    verdicts: Mapping[str, str]
    """By requirement."""


class Change(NamedTuple):
    """From one report on a testee to the next."""

    before: str
    after: str
    mended: list[str]
    broken: list[str]
    unseen: list[str]
    """What was observed before, and is not any more."""


class Comparison(NamedTuple):
    """Reports on one side by one version of the harness: another judges otherwise."""

    side: str
    harness: str
    columns: Sequence[Column]

    @property
    def rows(self) -> dict[str, list[str]]:
        """The verdicts on each requirement that one breaks, or that not all meet alike."""
        return {
            id: told
            for id, told in self._all().items()
            if len({*told}) > 1 or not NOT_KEPT.isdisjoint(told)
        }

    @property
    def alike(self) -> Counter[str]:
        """How many requirements have which verdict in every report."""
        rows = self.rows
        return Counter(told[0] for id, told in self._all().items() if id not in rows)

    @property
    def changes(self) -> list[Change]:
        """Between reports that follow each other on one testee."""
        pairs = pairwise(self.columns)
        return [_change(a, b) for a, b in pairs if a.report["testee"] == b.report["testee"]]

    def _all(self) -> dict[str, list[str]]:
        ids = dict.fromkeys(id for each in self.columns for id in each.verdicts)
        return {id: [each.verdicts.get(id, UNSEEN) for each in self.columns] for id in ids}


def compared(reports: Iterable[tuple[str, Report]]) -> list[Comparison]:
    """The reports, each with its label, in the order in which they come."""
    found: dict[tuple[str, str], list[Column]] = {}
    for label, report in reports:
        verdicts = {each["id"]: each["verdict"] for each in report["requirements"]}
        key = report["side"], report["environment"]["harness"]
        found.setdefault(key, []).append(Column(label, report, verdicts))
    return [Comparison(*key, columns) for key, columns in found.items()]


def _change(before: Column, after: Column) -> Change:
    then, now = before.verdicts, after.verdicts
    return Change(
        before.label,
        after.label,
        [id for id in now if now[id] == "pass" and then.get(id) in NOT_KEPT],
        [id for id in now if now[id] in NOT_KEPT and then.get(id) not in NOT_KEPT],
        [id for id in then if then[id] != UNSEEN and now.get(id, UNSEEN) == UNSEEN],
    )


def circumstances(column: Column) -> str:
    """Which program it was, and how it was judged."""
    it = column.report
    profile = f"; profile {it['profile']}" if it["profile"] else ""
    return f"{it['testee']}: {it['summary']}{profile}; {it['made'][:10]}"


def told(change: Change) -> Iterator[str]:
    """What has changed, a line for each kind."""
    where = f"{change.before} to {change.after}"
    for what, ids in (
        ("mended", change.mended),
        ("newly broken", change.broken),
        ("no longer observed", change.unseen),
    ):
        if ids:
            yield f"{where}: {what}: {', '.join(ids)}"
    if not (change.mended or change.broken or change.unseen):
        yield f"{where}: nothing has changed"


def markdown_comparison(found: Iterable[Comparison]) -> str:
    """All of it, for a page or the summary of a CI step."""
    return "\n".join(line for each in found for line in _markdown(each)) + "\n"


def _markdown(it: Comparison) -> Iterator[str]:
    yield f"## SplatBus {it.side}s, judged by splatbus-conformance {plain(it.harness)}\n"
    yield from (f"- {code(each.label)}: {plain(circumstances(each))}" for each in it.columns)
    yield from (f"- {plain(line)}" for change in it.changes for line in told(change))
    yield f"\n| | {' | '.join(code(each.label) for each in it.columns)} |"
    yield f"|---|{'---|' * len(it.columns)}"
    for id, verdicts in it.rows.items():
        yield f"| {id} | {' | '.join(VERDICTS[each] for each in verdicts)} |"
    yield f"\n{alike(it)}\n"


def alike(it: Comparison) -> str:
    """What is not in the table."""
    counts = ", ".join(f"{count} {VERDICTS[each]}" for each, count in it.alike.items())
    return f"The same in all: {counts or 'nothing'}."
