"""What the proxy shows of a session: a screen that is drawn again and again, or lines of text."""

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from splatbus_conformance.observe.audit import AuditFinding
from splatbus_conformance.observe.live import End, KindStatistics, Latency, Seen
from splatbus_conformance.reports.terminal import STYLE
from splatbus_conformance.verdicts import Verdict

WIDE = 130
"""Columns from which messages and answers stand beside each other."""
LATE_SECONDS = 2.0
MOST_BROKEN = 4
"""Findings that stay on the screen; all of them scroll by above it."""
SENDER = {"c2s": "client", "s2c": "server"}
STATE_STYLE = {"open": "green", "ended": "dim", "reset": "yellow"}


def screen(
    title: str, seen: Seen, broken: Sequence[AuditFinding], behind: float, columns: int, rows: int
) -> RenderableType:
    """A screen of so many columns and rows."""
    head = [
        Text(f"{title}   {_clock(seen.now)}", "bold", no_wrap=True, overflow="ellipsis"),
        _opinion(broken),
        *(_brief(finding) for finding in broken[-MOST_BROKEN:]),
    ]
    if behind > LATE_SECONDS:
        head.append(Text(f"{behind:.0f} s late: the session itself goes first", "yellow"))
    above: list[RenderableType] = [*head, Text(), _connections(seen), Text()]
    room = rows - len(head) - 4 - max(2, len(seen.connections)) - 1
    if not seen.lines:
        return Group(*above, Text("nobody has said anything yet", "dim"))
    if columns >= WIDE:
        beside = Table.grid(padding=(0, 4))
        beside.add_row(_messages(seen.lines, room), _answers(seen.latencies))
        return Group(*above, beside)
    room -= len(seen.latencies) + 2
    return Group(*above, _messages(seen.lines, room), Text(), _answers(seen.latencies))


def line(seen: Seen, broken: Sequence[AuditFinding], behind: float) -> str:
    """The same in one line."""
    rate = sum(it.per_second for it in seen.lines)
    parts = [
        f"{_clock(seen.now)}  {sum(it.seen for it in seen.lines):,} messages, {rate:,.0f} a second",
        ", ".join(
            f"{channel} {sum(_is_open(it) for it in seen.connections if it.channel == channel)}"
            f" of {count} connections open"
            for channel, count in seen.counts
        ),
        *(
            f"{it.what} {_milliseconds(it.p50)} ms, p99 {_milliseconds(it.p99)} ms"
            for it in seen.latencies
        ),
        _opinion(broken).plain,
    ]
    if behind > LATE_SECONDS:
        parts.append(f"{behind:.0f} s late")
    return "; ".join(parts)


def told(finding: AuditFinding) -> Text:
    """What is broken, as it is found."""
    assert finding.first
    place = finding.first.place
    return Text.assemble(
        (f"{finding.verdict.upper()} ", STYLE[finding.verdict]),
        (f"{finding.requirement.id} ", "bold"),
        f"{finding.peer}, {place.channel} #{place.conn}, {place.t:.3f} s: ",
        finding.first.text,
        (f"\n     {finding.requirement.sentence}", "dim"),
    )


def _brief(finding: AuditFinding) -> Text:
    assert finding.first
    return Text.assemble(
        (f"  {finding.requirement.id} ", STYLE[finding.verdict]),
        f"{finding.peer}, {finding.broken:,} of {finding.exercised:,} times: ",
        finding.first.text,
        no_wrap=True,
        overflow="ellipsis",
    )


def _opinion(broken: Sequence[AuditFinding]) -> Text:
    if not broken:
        return Text("nothing broken so far", "green")
    worst = Verdict.FAIL if any(it.verdict is Verdict.FAIL for it in broken) else Verdict.WARN
    ids = ", ".join(f"{finding.requirement.id} ({finding.peer})" for finding in broken)
    return Text(f"{len(broken)} broken: {ids}", STYLE[worst], no_wrap=True, overflow="ellipsis")


def _connections(seen: Seen) -> Table:
    table = _table("connection", "client", "server", "")
    counts = dict(seen.counts)
    for channel in counts:
        ends = [end for end in seen.connections if end.channel == channel]
        for end in ends:
            of = f"{counts[channel]} so far" if end is ends[0] and counts[channel] > 1 else ""
            table.add_row(
                f"{channel} #{end.number}",
                *(Text(state, STATE_STYLE[state]) for state in (end.client, end.server)),
                Text(of, "dim"),
            )
        if not ends:
            table.add_row(channel, Text("not yet", "dim"), "", "")
    return table


def _messages(lines: Sequence[KindStatistics], room: int) -> Table:
    table = _table("channel", "from", "message", *("seen", "a second", "bytes"))
    shown = lines if len(lines) <= room else _busiest(lines, max(1, room - 1))
    for it in shown:
        table.add_row(
            it.channel,
            SENDER[it.direction],
            it.kind,
            f"{it.seen:,}",
            f"{it.per_second:,.1f}" if it.per_second else "",
            f"{it.bytes:,}",
        )
    if left := len(lines) - len(shown):
        table.add_row("", "", Text(f"and {left} more kinds", "dim"))
    return table


def _busiest(lines: Sequence[KindStatistics], count: int) -> list[KindStatistics]:
    """So many of them, in their order."""
    busiest = sorted(lines, key=lambda it: (it.per_second, it.seen), reverse=True)[:count]
    return [it for it in lines if it in busiest]


def _answers(latencies: Sequence[Latency]) -> Table:
    table = _table("answer, in ms", "times", "median", "p99", "longest")
    for it in latencies:
        figures = map(_milliseconds, (it.p50, it.p99, it.slowest))
        table.add_row(it.what, f"{it.times:,}", *figures)
    return table


def _table(*names: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    for name in names:
        is_number = name in ("seen", "a second", "bytes", "times", "median", "p99", "longest")
        table.add_column(name, justify="right" if is_number else "left", no_wrap=True)
    return table


def _is_open(end: End) -> bool:
    return "open" in (end.client, end.server)


def _milliseconds(seconds: float) -> str:
    """Two digits that count: a histogram tells no more."""
    figure = float(f"{seconds * 1e3:.2g}")
    return f"{figure:,.0f}" if figure >= 10.0 else f"{figure:g}"


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{seconds:02}"
