"""Which checks and rules a run uses: terms that name an id, a clause, a level or a check.

`FRM-3` is an id, `FRM` a clause, `L0` to `L3` are levels (L0 is what the rules find), and
`check_any_segmentation` is a check.
"""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

MUCH_LESS_ALIKE = 0.15
"""By how much a name may be less like a word than the name that is most like it."""
PROFILES = ("brief", "quick", "full", "soak")
"""The shortest first."""
LEVELS = ("L0", "L1", "L2", "L3")
RULE = "rule"
"""The name under which results list what the passive rules found."""


class Item(NamedTuple):
    """What can be selected: a check, or a requirement that rules judge."""

    requirement: str
    name: str
    """Of the check; RULE for rules."""
    level: str
    profile: str = PROFILES[0]
    """The shortest that uses it."""

    def answers_to(self, term: str) -> bool:
        """Whether a term means this item."""
        return term in (self.requirement, self.clause, self.level, self.name)

    @property
    def clause(self) -> str:
        """`FRM` of `FRM-3`."""
        return self.requirement.partition("-")[0]


class UnknownTermError(ValueError):
    """A term means nothing; the message says what there is."""


@dataclass(frozen=True)
class Selection:
    """The terms that were given; without any, the profile alone decides."""

    only: tuple[str, ...] = ()
    never: tuple[str, ...] = ()

    def takes(self, item: Item, profile: str = "quick") -> bool:
        """Whether a run of this profile uses the item.

        What is named itself, by its id or as a check, runs in any profile.
        """
        if any(item.answers_to(term) for term in self.never):
            return False
        if self.only and not any(item.answers_to(term) for term in self.only):
            return False
        named = item.requirement in self.only or item.name in self.only
        return named or PROFILES.index(profile) >= PROFILES.index(item.profile)

    @property
    def partial(self) -> bool:
        """It leaves something out."""
        return bool(self.only or self.never)


ALL = Selection()


def terms(
    text: str, items: Iterable[Item], judged_by: Mapping[str, tuple[str, ...]]
) -> tuple[str, ...]:
    """The comma-separated terms in `text`, upper and lower case as the items have it; for an id of
    the other side, those by which it is judged what is done where that is broken.

    Raises UnknownTermError for one that means none of the items.
    """
    known = spellings(items)
    found = []
    for term in filter(None, (part.strip() for part in text.split(","))):
        judges = [it for it in judged_by.get(term.lower(), ()) if it.lower() in known]
        if term.lower() not in known and not judges:
            raise UnknownTermError(_what_there_is(term, known))
        found += [known[term.lower()]] if term.lower() in known else judges
    return tuple(dict.fromkeys(found))


def spellings(items: Iterable[Item]) -> dict[str, str]:
    """Every term that means something, by its lower-case spelling."""
    known = {level.lower(): level for level in LEVELS}
    for item in items:
        for term in (item.requirement, item.clause, item.name):
            if term != RULE:
                known[term.lower()] = term
    return known


def did_you_mean(word: str, known: Mapping[str, object]) -> str:
    """The names that are close to a word, as they are spelled; nothing if none is."""
    near = difflib.get_close_matches(word, known, 3)
    alike = [difflib.SequenceMatcher(None, it, word).ratio() for it in near]
    best = max(alike, default=0.0) - MUCH_LESS_ALIKE
    told = [str(known[it]) for it, ratio in zip(near, alike, strict=True) if ratio > best]
    return f"did you mean {' or '.join(told)}? " if told else ""


def _what_there_is(term: str, known: dict[str, str]) -> str:
    hint = did_you_mean(term.lower(), known)
    clauses = sorted({name for name in known.values() if len(name) == 3 and name.isupper()})
    return (
        f"{term} is no id, clause, level or check that is judged here; {hint}"
        f"clauses are {', '.join(clauses)}, levels {', '.join(LEVELS)}"
    )
