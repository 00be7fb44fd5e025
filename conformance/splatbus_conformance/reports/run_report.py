"""All that is said of a run, made once: terminal, files and exit status are views of it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.plan import Side
from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.reports.thresholds import observed
from splatbus_conformance.verdicts import Level, Result, Verdict, by_requirement, worst


@dataclass(frozen=True)
class RunReport:
    """What came of a live run, of a recording or of a replay."""

    testee: str
    """Its command, or what else was judged."""
    side: Side
    sentence: str
    """The verdict."""
    results: Sequence[Result]
    """Of all checks and rules."""
    judged: Mapping[str, Requirement]
    """The requirements that it could be judged by."""
    status: int
    """With which the command exits."""
    traffic: Traffic
    seconds: float
    """How long the run took, or the session that was recorded."""
    least: Level = Level.PASSIVE
    """The least assurance at which something counts as observed."""
    complaints: Sequence[str] = ()
    """What fails the run besides verdicts."""
    deselected: Mapping[str, list[str]] = field(default_factory=dict)
    """By requirement, what the user left out."""
    not_judged: Sequence[str] = ()
    """What a recording holds that no rule could judge."""
    unseen: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """By reason, the requirements that nothing was said of."""
    profile: str | None = None
    """How many cases were asked for; None where no cases were drawn."""
    seeds: Sequence[int] = ()
    """Of the drawn cases."""
    recorded: bool = False
    """What crossed the wire was kept."""
    cut: str = ""
    """Why it ended before all checks had run."""


def summary(
    results: Iterable[Result],
    judged: Mapping[str, Requirement],
    level: str,
    least: Level = Level.PASSIVE,
    why_none: str = "",
) -> tuple[str, dict[str, Verdict]]:
    """One sentence on a run, and the verdict on each requirement that could be judged.

    Args:
        results: of all checks and rules.
        judged: the requirements that the testee could be judged by.
        level: the assurance at which the run takes place.
        least: the least assurance at which something counts as observed.
        why_none: what keeps the run from a verdict that nothing else gives it.
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
    elif why_none or not count:
        opinion = f"no verdict: {why_none or 'nothing was observed'}"
    else:
        opinion = f"conforming at {level}"
    mark = ";" if of[Verdict.FAIL] or why_none else ":"
    text = f"{opinion}{mark} {count} of {len(judged)} requirements observed"
    if least > Level.PASSIVE:
        text += f" at {least} or above"
    if of[Verdict.EXPECTED]:
        text += f"; expected to be broken: {', '.join(of[Verdict.EXPECTED])}"
    if of[Verdict.WARN]:
        text += f"; advice not followed: {', '.join(of[Verdict.WARN])}"
    return text, verdicts
