"""How much a run has to have seen: too little is a failure too, or is told."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from splatbus_schemas import VERSIONS
from splatbus_schemas.requirements import Requirement

from splatbus_conformance.verdicts import Level, Result, Verdict, by_requirement, worst


@dataclass(frozen=True)
class Thresholds:
    """What `--require-level`, `--require-coverage` and `--require-version` ask for."""

    level: Level = Level.PASSIVE
    """A verdict of less assurance counts for nothing here."""
    coverage: float = 0.0
    """The share of the MUSTs on this testee that have to be observed."""
    version: str = VERSIONS[0]
    """That the testee has to speak, or a later one."""


def observed(
    results: Iterable[Result], judged: Mapping[str, Requirement], level: Level = Level.PASSIVE
) -> set[str]:
    """The requirements with a verdict of at least this assurance, and no mere skip or error."""
    enough = [result for result in results if result.level >= level]
    return {
        name
        for name, group in by_requirement(enough).items()
        if name in judged and worst(group) not in (Verdict.SKIP, Verdict.ERROR)
    }


def missing(
    results: Iterable[Result], judged: Mapping[str, Requirement], late_seconds: float, load: str
) -> str:
    """Which requirements a busy machine may have kept from being observed, in words: of each the
    testee has shown what it takes, and yet nothing came of a check in which the harness was late.
    """
    results = list(results)
    shown = {it.requirement for it in results if it.missed and it.requirement in judged}
    unseen = shown - observed(results, judged)
    missed = [name for name in judged if name in unseen]
    if not missed:
        return ""
    return (
        f"Not observed, though the testee can show them: {', '.join(missed)}. "
        f"{was_busy(late_seconds, load)}."
    )


def was_busy(late_seconds: float, load: str) -> str:
    """That the machine was, in words."""
    return f"The machine was busy: the harness itself was up to {late_seconds:.1f} s late{load}"


def shortfalls(
    results: Iterable[Result],
    judged: Mapping[str, Requirement],
    demands: Thresholds,
    version: str,
) -> list[str]:
    """A sentence for each demand that a run on a testee of this version does not meet."""
    seen = observed(results, judged, demands.level)
    musts = [name for name, it in judged.items() if it.level.startswith("MUST")]
    count = sum(name in seen for name in musts)
    at = f" at {demands.level} or above" if demands.level > Level.PASSIVE else ""
    found = []
    if version in VERSIONS[: VERSIONS.index(demands.version)]:
        found.append(
            f"--require-version {demands.version}: the testee speaks only {version}; it said"
            " nothing of a later version, such as hello or welcome, on either channel"
        )
    if demands.level > Level.PASSIVE and not seen:
        found.append(f"--require-level {demands.level}: nothing was observed{at}")
    if count < demands.coverage * len(musts):
        share = count / len(musts)
        found.append(
            f"--require-coverage {demands.coverage:.0%}: {count} of {len(musts)} MUSTs were "
            f"observed{at}, which is {share:.0%}; the reasons of the skips say how to see "
            "more"
        )
    return found
