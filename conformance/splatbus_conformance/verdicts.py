"""Verdicts: what the harness says about a requirement, and how many of them make an exit code."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from splatbus_conformance.measurements import Measurement

EXIT_CONFORMING = 0
EXIT_NOT_CONFORMING = 1
EXIT_USAGE = 2
EXIT_NO_VERDICT = 3
EXIT_INTERRUPTED = 130
INTERRUPTED = "the run was interrupted"


class Verdict(StrEnum):
    """What is said of one check, and of a requirement by the worst of its checks."""

    PASS = "pass"
    FAIL = "fail"
    WARN = "warn"
    SKIP = "skip"
    ERROR = "harness-error"
    EXPECTED = "expected"
    """A failure that a list of expected failures knows (`expected.py`)."""


BROKEN = (Verdict.FAIL, Verdict.WARN)
"""What is held against the testee."""


class Level(StrEnum):
    """How a verdict was reached: assurance grows with the number."""

    PASSIVE = "L0"
    WIRE = "L1"
    ADAPTER = "L2"
    MEMORY = "L3"


_WORST_FIRST = (
    *(Verdict.FAIL, Verdict.ERROR, Verdict.WARN, Verdict.EXPECTED, Verdict.PASS, Verdict.SKIP),
)


@dataclass(frozen=True)
class Result:
    """What one check found out about one requirement."""

    requirement: str
    check: str
    level: Level
    verdict: Verdict
    text: str = ""
    """Why: the reason of a skip, the breach of a failure, what was seen for a pass."""
    evidence: tuple[str, ...] = field(default=())
    """Lines of transcript that show it."""
    seconds: float = 0.0
    measurements: tuple[Measurement, ...] = ()
    """How far off the testee was."""
    script: str = ""
    """What was delivered where it failed, as text (`script.py`)."""
    smallest: str = ""
    """How small a script shows it, and whether it did so again."""
    replay: str = ""
    """The command that shows it again."""
    delivered: int = 0
    """Cases that were delivered, each followed by a control that the testee met."""
    missed: bool = False
    """A skip, though the testee has shown all that the check needs, while the harness came late."""
    code: str = ""
    """Of a failure, which of the ways to fail this check it is: by this it is told from others,
    however the text puts it.
    """
    pictures: tuple[tuple[str, str], ...] = ()
    """Of the image that a failure is about: a title and a PNG in base64 each."""


def worst(results: Iterable[Result]) -> Verdict:
    """The verdict on a requirement from its results; a pass outweighs a skip."""
    verdicts = {result.verdict for result in results}
    return next((verdict for verdict in _WORST_FIRST if verdict in verdicts), Verdict.SKIP)


def by_requirement(results: Iterable[Result]) -> dict[str, list[Result]]:
    """Results grouped by requirement, in the order in which they came."""
    groups: dict[str, list[Result]] = {}
    for result in results:
        groups.setdefault(result.requirement, []).append(result)
    return groups


def reached(results: Iterable[Result]) -> Level:
    """The highest assurance at which something was found to be right."""
    return max((it.level for it in results if it.verdict is Verdict.PASS), default=Level.PASSIVE)


def failing(level: str) -> Verdict:
    """What breaking a requirement of this level (MUST, SHOULD, …) is called."""
    return Verdict.FAIL if level.startswith("MUST") else Verdict.WARN


def exit_code(verdicts: Mapping[str, Verdict], *, strict: bool = False) -> int:
    """The exit code for the verdicts of all requirements: not conforming wins over no verdict."""
    seen = set(verdicts.values())
    if Verdict.FAIL in seen or (strict and Verdict.WARN in seen):
        return EXIT_NOT_CONFORMING
    if Verdict.ERROR in seen or not seen & {Verdict.PASS, Verdict.WARN, Verdict.EXPECTED}:
        return EXIT_NO_VERDICT
    return EXIT_CONFORMING
