"""What a run has come to no word on, and why: where a check was skipped, the check says it."""

from collections.abc import Iterable, Mapping

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.checks.registry import exclusions, judges
from splatbus_conformance.verdicts import Result

NOTHING_CAME = "nothing on the wire was about it"
NOT_RUN = "its checks did not run; a live run with --profile full runs them all"
NOWHERE = "no run can show it"


def unseen(
    results: Iterable[Result], judged: Mapping[str, Requirement], side: str
) -> dict[str, list[str]]:
    """For each reason, the requirements that the testee could be judged by, and on which nothing
    was said at all.

    Args:
        results: of all checks and rules of a run that had none deselected.
        judged: the requirements that the testee could be judged by.
        side: on which the testee is.
    """
    said = {result.requirement for result in results}
    found: dict[str, list[str]] = {}
    for name in judged:
        if name not in said:
            found.setdefault(why(name, side), []).append(name)
    return found


def why(name: str, side: str) -> str:
    """Why nothing was said of a requirement in a run that had none deselected."""
    if excluded := exclusions(side).get(name):
        return f"{NOWHERE}: {excluded.reason}"
    by_rules_alone = all(judge.level == "L0" for judge in judges(side).get(name, ()))
    return NOTHING_CAME if by_rules_alone else NOT_RUN
