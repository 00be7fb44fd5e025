"""Make a list of cases smaller while it fails: delta debugging (Zeller, Hildebrandt 2002)."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

T = TypeVar("T")
Fails = Callable[[Sequence[T]], bool]


def smallest(cases: Sequence[T], fails: Fails[T], in_time: Callable[[], bool]) -> list[T]:
    """The shortest list found that still fails; `cases` itself if none does.

    The last case is tried alone first: in most failures it needs none of those before it.

    Args:
        cases: a list that is known to fail.
        fails: whether a shorter list fails too.
        in_time: whether there is time to try another.
    """
    kept = list(cases)
    if len(kept) > 1 and in_time() and fails(kept[-1:]):
        return kept[-1:]
    parts = 2
    while len(kept) > 1 and in_time():
        step = -(-len(kept) // parts)
        chunks = [kept[at : at + step] for at in range(0, len(kept), step)]
        for number in range(len(chunks)):
            rest = [case for other in chunks[:number] + chunks[number + 1 :] for case in other]
            if in_time() and fails(rest):
                kept, parts = rest, max(parts - 1, 2)
                break
        else:
            if parts >= len(kept):
                break
            parts = min(2 * parts, len(kept))
    return kept


def simplest(
    case: T,
    simpler: Callable[[T], Iterable[T]],
    fails: Callable[[T], bool],
    in_time: Callable[[], bool],
) -> T:
    """The simplest case found that still fails, one step of `simpler` after the other."""
    while in_time():
        for other in simpler(case):
            if in_time() and fails(other):
                case = other
                break
        else:
            break
    return case


def without_one(case: list[T]) -> list[list[T]]:
    """The list without its second half, without its first, and without each of its elements."""
    half = len(case) // 2
    halves = [case[:half], case[half:]] if half > 1 else []
    return halves + [case[:at] + case[at + 1 :] for at in range(len(case))]
