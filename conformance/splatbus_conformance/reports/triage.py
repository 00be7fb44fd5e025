"""Which failure to look at first: what others rest on comes before them."""

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from splatbus_conformance.verdicts import Level, Result, Verdict

LAYERS = (
    (("FRM",), "without whole packets nothing is understood"),
    (("JSN",), "a message that cannot be read has no effect"),
    (("CHN", "NEG"), "without its connections a testee shows little"),
    (("INI", "MEM", "OPN", "CUD"), "without memory there are no images"),
)
"""Clauses that others rest on, lowest first, and why."""
ROOTS = {
    "removed-memory": "it removed the memory, so nobody can open it any more",
    "wrote-to-memory": "it wrote to the memory, where others look for images",
    "unknown-image": "it does not give an image back, so no other follows",
    "unknown-generation": "it does not answer for the memory, so no image comes in it",
}
"""Codes of failures that others come of, and why."""
PARSER = ("JSN-6", "JSN-7", "JSN-8", "JSN-9", "JSN-10")
"""What is asked of who reads a text."""
_RANK = {clause: rank for rank, (clauses, _) in enumerate(LAYERS) for clause in clauses}
MANY = 3
_SEVEREST = (Verdict.FAIL, Verdict.ERROR, Verdict.WARN)


class Cause(NamedTuple):
    """A requirement whose failure others may come of."""

    first: str
    others: frozenset[str]
    why: str

    def __str__(self) -> str:
        return f"Start with {self.first}: {self.why}."


def in_order(results: Iterable[Result]) -> list[Result]:
    """What was broken, in the order in which to look at it: failures before advice that was not
    followed; those that others come of first; what the testee sends by itself before what it makes
    of what it is sent; and of those, lower layers first. Below a cause comes what may follow.
    """
    broken = _broken(results := list(results))
    if (known := cause(results)) is None:
        return broken
    first, others, _ = known
    return sorted(broken, key=lambda it: (it.requirement != first, it.requirement not in others))


def cause(results: Sequence[Result]) -> Cause | None:
    """Which failure to mend first, if there is reason to believe that others come of it.

    Only what a testee sends by itself spoils what follows, and what it does to the memory: how it
    takes hostile input does not, unless one parser takes much of it wrongly.
    """
    ordered = [it for it in _broken(results) if it.verdict is Verdict.FAIL]
    names = {it.requirement for it in ordered}
    if ordered and (why := ROOTS.get(ordered[0].code)) and len(names) > 1:
        first, others = ordered[0].requirement, names - {ordered[0].requirement}
        told = f"{why}; {_counted(others, 'other failure')} may follow from it"
        return Cause(first, frozenset(others), told)
    left = list(dict.fromkeys(it.requirement for it in ordered if it.code == "exits"))
    if len(left) >= MANY:
        told = f"in {len(left)} failures its process ends; it has to run until the harness ends it"
        return Cause(left[0], frozenset(left[1:]), told)
    if len(read := [it for it in PARSER if it in names]) >= MANY:
        told = f"{', '.join(read)} are all about the same parser"
        return Cause(read[0], frozenset(read[1:]), told)
    if not ordered or not _by_itself(ordered[0]) or _rank(ordered[0]) > _RANK["JSN"]:
        return None
    first, rank = ordered[0].requirement, _rank(ordered[0])
    above = frozenset(it.requirement for it in ordered if _rank(it) > rank)
    seen = {it.requirement for it in results if it.verdict is not Verdict.SKIP}
    unseen = {it.requirement for it in results} - seen
    follow = []
    if above:
        follow.append(f"{_counted(above, 'other failure')} may follow from it")
    if len(unseen) > len(seen):
        follow.append("it may be why most requirements could not be observed")
    if not follow:
        return None
    return Cause(first, above, f"{LAYERS[rank][1]}; {', and '.join(follow)}")


def start_with(results: Sequence[Result]) -> str:
    """The same as a sentence; nothing if there is no such reason."""
    return str(cause(results) or "")


def _broken(results: Iterable[Result]) -> list[Result]:
    return sorted((it for it in results if it.verdict in _SEVEREST), key=_place)


def _place(result: Result) -> tuple[int, bool, bool, int]:
    severity, is_root = _SEVEREST.index(result.verdict), result.code in ROOTS
    return severity, not is_root, not _by_itself(result), _rank(result)


def _counted(names: Collection[str], word: str) -> str:
    return f"{len(names)} {word}{'s' if len(names) != 1 else ''}"


def _rank(result: Result) -> int:
    return _RANK.get(result.requirement[:3], len(LAYERS))


def _by_itself(result: Result) -> bool:
    return result.level is Level.PASSIVE
