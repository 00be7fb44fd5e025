"""What a person sees while the harness runs, and at its end."""

import re
import textwrap
import time
from collections.abc import Collection, Iterable, Mapping, Sequence

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Column
from rich.text import Text
from splatbus_schemas.requirements import Requirement, requirements

from splatbus_conformance.reports.claim import claim
from splatbus_conformance.reports.run_report import RunReport
from splatbus_conformance.reports.triage import cause, in_order, start_with
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NOT_CONFORMING,
    Level,
    Result,
    Verdict,
)
from splatbus_conformance.wire.transcript import INDENT, MARK

STYLE = {
    Verdict.PASS: "green",
    Verdict.FAIL: "bold red",
    Verdict.WARN: "yellow",
    Verdict.SKIP: "dim",
    Verdict.ERROR: "bold magenta",
    Verdict.EXPECTED: "cyan",
}
CONFORMS = "conforms"
"""The outcome of a requirement whose sentence says all that it accepts."""
SHOWN_WITH_BYTES = 5
"""Failures; those after them are told by their sentences and the command that shows them."""
LEAST_COLUMNS = 20
TELL_SECONDS = 15.0
"""How often it is said, where no line can be rewritten, how long the run will take."""
FORETOLD = 0.05
"""The share of a run that has to be done before it is said how long the rest takes."""
_STYLE_OF_END = {EXIT_CONFORMING: "bold green", EXIT_NOT_CONFORMING: "bold red"}
_VERSION = re.compile(r"\b(\d) (\d)\b")
_ONE_LINE = Column(no_wrap=True, overflow="ellipsis", ratio=1)


class LiveProgress:
    """Says what runs now, and what came of it: one line for each check that said something, and
    on a terminal a last one, rewritten, with what runs. Why checks were skipped is told at the end,
    once for each reason.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._seconds: Mapping[str, float] = {}
        """How long each check took once."""
        self._left: set[str] = set()
        """Checks that have no verdict yet."""
        self._began = self._told = time.monotonic()
        self._running: dict[str, str] = {}
        """By check, what it says that it judges."""
        self._skipped: dict[str, list[str]] = {}
        """By reason, the requirements whose checks were skipped for it."""
        self._judged: set[str] = set()
        """Those of which another check has said something."""
        self._bar = _bar(console) if console.is_terminal else None
        self._task = None
        if self._bar:
            self._task = self._bar.add_task("meeting the testee", total=None, left="")

    def say(self, text: str) -> None:
        """Something that the user has to do or know."""
        self._console.print(text)
        self._show()

    def begin(self, seconds: Mapping[str, float]) -> None:
        """These checks will run, each of which took so many seconds once."""
        self._seconds, self._left = seconds, set(seconds)
        self._began = self._told = time.monotonic()
        self._running.clear()
        self._show()

    def start(self, check: str, requirement: str) -> None:
        """This one runs now, beside those that run already."""
        self._running[check] = f"{requirement} {words(check)}"
        self._show()

    def done(self, result: Result) -> None:
        """One has its verdict."""
        self._left.discard(result.check)
        self._running.pop(result.check, None)
        if result.verdict is Verdict.SKIP:
            self._skipped.setdefault(result.text, []).append(result.requirement)
        else:
            self._judged.add(result.requirement)
            self._console.print(
                _line(result, self._place),
                no_wrap=True,
                overflow="ellipsis",
                crop=self._console.is_terminal,
            )
        if not self._bar and time.monotonic() > self._told + TELL_SECONDS and self._left:
            self._told = time.monotonic()
            self._console.print(f"{self._place}  {self._time_left}", style="dim")
        self._show()

    def end(self) -> None:
        """The run is over."""
        if self._bar:
            self._bar.stop()
        print_skipped(self._console, self._skipped, self._judged)
        self._skipped, self._judged = {}, set()

    @property
    def _place(self) -> str:
        return f"{len(self._seconds) - len(self._left):4}/{len(self._seconds)}"

    @property
    def _time_left(self) -> str:
        """By what those took once that are done and that are not, at the pace of this run."""
        left = sum(self._seconds[name] for name in self._left)
        done = sum(self._seconds.values()) - left
        if done < FORETOLD * (done + left):
            return ""
        return f"about {(time.monotonic() - self._began) / done * left:.0f} s left"

    def _show(self) -> None:
        if self._bar and self._task is not None:
            self._bar.start()
            total = len(self._seconds)
            self._bar.update(
                self._task,
                completed=total - len(self._left),
                total=total or None,
                left=self._time_left,
            )
            if self._running:
                self._bar.update(self._task, description="; ".join(self._running.values()))


def _bar(console: Console) -> Progress:
    """One line: how far the run is, for how long it has run and will, and what runs now."""
    return Progress(
        SpinnerColumn(),
        MofNCompleteColumn(),
        BarColumn(20),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}", markup=False),
        TextColumn("{task.description}", markup=False, table_column=_ONE_LINE),
        console=console,
        transient=True,
        expand=True,
    )


def _line(result: Result, place: str) -> Text:
    line = Text(f"{place}  {result.requirement:<7} ")
    line.append(f"{result.verdict:<7}", STYLE[result.verdict])
    line.append(f" {words(result.check)}")
    if result.verdict is not Verdict.PASS and result.text:
        line.append(f": {result.text.splitlines()[0]}", "dim")
    return line


def print_skipped(
    console: Console, skipped: Mapping[str, Sequence[str]], judged: Collection[str]
) -> None:
    """Why checks were skipped, the most frequent reason first, and what they would have judged."""
    told = {why: [f"({it})" if it in judged else it for it in ids] for why, ids in skipped.items()}
    others = " (ids in brackets were judged by other checks)" if told != dict(skipped) else ""
    _print_by_reason(console, f"\nSkipped, and why{others}:", told)


def print_unseen(console: Console, unseen: Mapping[str, Sequence[str]]) -> None:
    """The requirements that nothing was said of, by reason."""
    _print_by_reason(console, "\nNot seen, and why:", unseen)


def _print_by_reason(console: Console, title: str, found: Mapping[str, Sequence[str]]) -> None:
    if found:
        console.print(title)
    for reason, names in sorted(found.items(), key=lambda it: -len(it[1])):
        _print_hanging(console, f"{len(names):4}  ", reason)
        _print_hanging(console, " " * 6, " ".join(dict.fromkeys(names)), "dim")


def words(check: str) -> str:
    """The name of a check as words."""
    text = check.removeprefix("check_").replace("_", " ").replace(" s ", "'s ")
    return _VERSION.sub(r"\1.\2", text)


def print_failures(
    console: Console, results: Iterable[Result], known: Mapping[str, Requirement]
) -> None:
    """Each breach: the sentence, what the specification accepts, what came, and the bytes.

    In the order in which to look at them; the bytes of the first few only.
    """
    results = list(results)
    root = cause(results)
    for place, result in enumerate(in_order(results)):
        follows = (
            f"  may follow from {root.first}" if root and result.requirement in root.others else ""
        )
        style = STYLE[result.verdict]
        how = "in what it sent" if result.check == RULE else words(result.check)
        console.print()
        console.print(
            Text.assemble(
                *((result.verdict.upper(), style), " ", (result.requirement, "bold"), f"  {how} "),
                (f"({', '.join(filter(None, (result.level, result.code)))})", "dim"),
                (follows, "dim"),
            )
        )
        if requirement := known.get(result.requirement):
            _print_hanging(console, "  the standard   ", requirement.sentence)
            if requirement.acceptable != (CONFORMS,):
                _print_hanging(console, "  it accepts     ", ", ".join(requirement.acceptable))
        _print_hanging(console, "  what came      ", result.text, "bold")
        if place < SHOWN_WITH_BYTES:
            print_evidence(console, result.evidence)
        if result.replay:
            _print_hanging(console, "  smallest       ", result.smallest)
            console.print("  see it again   ", end="")
            console.print(result.replay, style="bold", soft_wrap=True)
    console.print()


def print_evidence(console: Console, lines: Iterable[str]) -> None:
    """A transcript, each line cut where the window ends, but for what the failure is about."""
    for line in lines:
        if line.startswith(MARK):
            _print_marked(console, line)
            continue
        style = "dim" if line.startswith(INDENT) else ""
        console.print(Text(f"    {line}", style), no_wrap=True, overflow="ellipsis")


def _print_marked(console: Console, line: str) -> None:
    room = max(console.width - 4, len(INDENT) + LEAST_COLUMNS)
    while line:
        console.print(Text(f"    {line[:room]}", STYLE[Verdict.FAIL]), soft_wrap=True)
        rest = line[room:]
        line = rest and f"{MARK}{INDENT[1:]}{rest}"


def _print_hanging(console: Console, label: str, text: str, style: str = "") -> None:
    """Text beside a label, its further lines below its first."""
    lines = textwrap.wrap(
        text,
        max(console.width - len(label), LEAST_COLUMNS),
        break_long_words=False,
        break_on_hyphens=False,
    )
    for place, line in enumerate(lines or [""]):
        console.print(
            Text.assemble(label if not place else " " * len(label), (line, style)), soft_wrap=True
        )


def print_what_next(
    console: Console, results: Iterable[Result], advice: Iterable[str], *, recorded: bool
) -> None:
    """What the meeting with the testee suggested, which failure to look at first, and how to look
    closer.
    """
    results = list(results)
    for text in filter(None, (*advice, start_with(results))):
        for line in text.splitlines():
            _print_hanging(console, " " * (len(line) - len(line.lstrip())), line.strip(), "bold")
        console.print()
    broken = [
        it.requirement
        for it in in_order(results)
        if it.verdict is Verdict.FAIL and it.level != Level.PASSIVE
    ]
    if broken and not recorded:
        ids = ",".join(dict.fromkeys(broken))
        console.print(
            f"To see all that crossed the wire, add: --select {ids} --record FOLDER\n",
            style="dim",
            soft_wrap=True,
        )


def print_run(console: Console, report: RunReport) -> None:
    """All that is said of a run: what was not seen, what was broken, what to do, the verdict."""
    print_unseen(console, report.unseen)
    print_failures(console, report.results, requirements("1.1"))
    print_what_next(console, report.results, report.traffic.advice, recorded=report.recorded)
    print_complaints(console, report.complaints)
    print_end(console, report.sentence, report.traffic.sentence(report.seconds), report.status)
    if claimed := claim(report):
        console.print(f"you may claim: {claimed}", style="dim")


def print_end(console: Console, sentence: str, more: str, status: int) -> None:
    """The last lines of a run."""
    console.print(sentence, style=_STYLE_OF_END.get(status, "bold yellow"))
    console.print(more, style="dim")


def print_complaints(console: Console, complaints: Iterable[str]) -> None:
    """What fails a run besides verdicts, and what to do about it."""
    for text in complaints:
        console.print(Text.assemble(("FAIL  ", STYLE[Verdict.FAIL]), text))
