"""What a person sees while the harness runs, and at its end."""

from collections.abc import Iterable, Mapping

from rich.console import Console
from rich.markup import escape
from rich.text import Text
from splatbus_schemas.requirements import Requirement

from splatbus_conformance.audit import Audit
from splatbus_conformance.demands import observed
from splatbus_conformance.verdicts import Level, Result, Verdict, by_requirement, worst

STYLE = {
    Verdict.PASS: "green",
    Verdict.FAIL: "bold red",
    Verdict.WARN: "yellow",
    Verdict.SKIP: "dim",
    Verdict.ERROR: "bold magenta",
    Verdict.EXPECTED: "cyan",
}


class Live:
    """Says what runs now, and what came of it: one line, rewritten, or one line for each check."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._total = 0
        self._done = 0
        self._running: dict[str, str] = {}
        """By check, what it says that it judges."""
        self._status = console.status("starting") if console.is_terminal else None

    def say(self, text: str) -> None:
        """Something that the user has to do or know."""
        self._console.print(text, markup=False)

    def begin(self, total: int) -> None:
        """So many checks will run."""
        self._total, self._done = total, 0
        self._running.clear()
        if self._status:
            self._status.start()

    def start(self, check: str, requirement: str) -> None:
        """This one runs now, beside those that run already."""
        self._running[check] = f"{requirement}  {words(check)}"
        self._show()

    def done(self, result: Result) -> None:
        """One has its verdict."""
        self._done += 1
        self._running.pop(result.check, None)
        line = Text(f"{self._done:4}/{self._total}  {result.requirement:<7} ")
        line.append(f"{result.verdict:<7}", STYLE[result.verdict])
        line.append(f" {words(result.check)}")
        if result.verdict is not Verdict.PASS:
            line.append(f": {result.text.splitlines()[0] if result.text else ''}", "dim")
        self._console.print(line, no_wrap=True, overflow="ellipsis", crop=self._console.is_terminal)
        self._show()

    def end(self) -> None:
        """The run is over."""
        if self._status:
            self._status.stop()

    def _show(self) -> None:
        if self._status and self._running:
            self._status.update(f"{self._done}/{self._total}  {'; '.join(self._running.values())}")


def words(check: str) -> str:
    """The name of a check as words."""
    return check.removeprefix("check_").replace("_", " ")


def print_failures(
    console: Console, results: Iterable[Result], known: Mapping[str, Requirement]
) -> None:
    """Each breach: the sentence, what the specification accepts, what came, and the bytes."""
    for result in results:
        if result.verdict not in (Verdict.FAIL, Verdict.WARN, Verdict.ERROR):
            continue
        style = STYLE[result.verdict]
        console.print()
        console.print(
            f"[{style}]{result.verdict.upper()}[/] [bold]{result.requirement}[/] "
            f"[dim]at {result.level}, {words(result.check)}[/]"
        )
        if requirement := known.get(result.requirement):
            console.print(f"  the standard   {escape(requirement.sentence)}")
            console.print(f"  acceptable     {', '.join(requirement.acceptable)}")
        console.print(f"  seen           {escape(result.text)}")
        for line in result.evidence:
            console.print(Text(f"    {line}", "dim"), no_wrap=True, overflow="ellipsis")
        if result.replay:
            console.print(f"  smallest       {escape(result.smallest)}")
            console.print("  to see it      ", end="")
            console.print(result.replay, style="bold", markup=False, soft_wrap=True)
    console.print()


def print_what_next(console: Console, results: Iterable[Result], *, recorded: bool) -> None:
    """How to look closer at what failed."""
    broken = [
        r.requirement for r in results if r.verdict is Verdict.FAIL and r.level != Level.PASSIVE
    ]
    if broken and not recorded:
        ids = ",".join(dict.fromkeys(broken))
        console.print(
            f"To see all that crossed the wire, add: --select {ids} --record FOLDER\n", style="dim"
        )


def print_connections(console: Console, name: str, judged: Audit) -> None:
    """What a recording holds, before what is said of it."""
    seen = ", ".join(f"{count} on {channel}" for channel, count in judged.connections.items())
    console.print(f"[bold]{escape(name)}[/]  connections: {seen}")
    for line in judged.left_over:
        console.print(Text(f"  not judged: {line}", "dim"))


def print_complaints(console: Console, complaints: Iterable[str]) -> None:
    """What fails a run besides verdicts, and what to do about it."""
    for text in complaints:
        console.print(Text.assemble(("FAIL  ", STYLE[Verdict.FAIL]), text))


def summary(
    results: Iterable[Result],
    judged: Mapping[str, Requirement],
    level: str,
    least: Level = Level.PASSIVE,
) -> tuple[str, dict[str, Verdict]]:
    """One sentence on a run, and the verdict on each requirement that could be judged.

    Args:
        results: of all checks and rules.
        judged: the requirements that the testee could be judged by.
        level: the assurance at which the run takes place.
        least: the least assurance at which something counts as observed.
    """
    results = list(results)
    groups = by_requirement(results)
    verdicts = {name: worst(groups.get(name, [])) for name in judged}
    verdicts |= {name: worst(group) for name, group in groups.items() if name not in judged}
    count = len(observed(results, judged, least))
    of = {
        verdict: [name for name, it in verdicts.items() if it is verdict]
        for verdict in (Verdict.FAIL, Verdict.EXPECTED, Verdict.WARN)
    }
    if of[Verdict.FAIL]:
        opinion = f"not conforming: {', '.join(of[Verdict.FAIL])} broken"
    elif Verdict.ERROR in verdicts.values():
        opinion = "no verdict: the harness failed"
    elif of[Verdict.EXPECTED]:
        opinion = "not conforming, as expected"
    elif not count:
        opinion = "no verdict: nothing was observed"
    else:
        opinion = f"conforming at {level}"
    text = f"{opinion}: {count} of {len(judged)} requirements observed"
    if least > Level.PASSIVE:
        text += f" at {least} or above"
    if of[Verdict.EXPECTED]:
        text += f"; expected to be broken: {', '.join(of[Verdict.EXPECTED])}"
    if of[Verdict.WARN]:
        text += f"; advice not followed: {', '.join(of[Verdict.WARN])}"
    return text, verdicts
