"""What the passive rules saw of one side, counted, so that recordings need not be kept."""

from collections import Counter
from collections.abc import Collection, Iterable
from typing import NamedTuple

from splatbus_conformance.rules import Breach, Rule, Sighting, all_rules, guilty
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import Level, Result, Verdict, failing
from splatbus_conformance.wire.conversation import Conversation


class Count(NamedTuple):
    """How often a requirement was exercised, how often broken, and the first breach."""

    seen: int = 0
    broken: int = 0
    first: Breach | None = None
    shown: tuple[str, ...] = ()
    """The bytes of the first breach, as a transcript shows them."""

    def plus(self, other: "Count") -> "Count":
        """Both together; this one came first."""
        first = self if self.first else other
        return Count(
            self.seen + other.seen, self.broken + other.broken, first.first, tuple(first.shown)
        )


Tally = dict[str, Count]
"""For each requirement, what was counted."""


def rules_on(ids: Collection[str]) -> tuple[Rule, ...]:
    """The rules that judge one of these requirements."""
    return tuple(rule for rule in all_rules() if not set(rule.judges).isdisjoint(ids))


def tally(recorded: Iterable[Conversation], side: str, rules: Iterable[Rule]) -> Tally:
    """What these rules see of one side in a recording."""
    rules = tuple(rules)
    seen: Counter[str] = Counter()
    breaches: dict[str, list[Sighting]] = {}
    for conversation in recorded:
        for rule in rules:
            for sighting in rule(conversation):
                if sighting.peer == side:
                    seen[sighting.requirement] += 1
                    if sighting.breach:
                        breaches.setdefault(sighting.requirement, []).append(sighting)
    return {
        name: Count(count, len(broken), broken[0].breach, guilty.shown(broken[0]))
        if (broken := breaches.get(name))
        else Count(count)
        for name, count in seen.items()
    }


def add(total: Tally, more: Tally) -> None:
    """Count what was seen elsewhere as well."""
    for name, count in more.items():
        total[name] = total.get(name, Count()).plus(count)


def result(requirement: str, count: Count, level: str) -> Result:
    """The verdict of the rules on a requirement of this level (MUST, SHOULD, …)."""
    if not count.broken:
        text = f"held {count.seen} times of {count.seen}"
        return Result(requirement, RULE, Level.PASSIVE, Verdict.PASS, text)
    times = f"{count.broken} of {count.seen}" if count.seen > 1 else "the only one"
    text = f"{count.first} ({times})"
    code = count.first.code if count.first else ""
    verdict = failing(level)
    return Result(requirement, RULE, Level.PASSIVE, verdict, text, tuple(count.shown), code=code)
