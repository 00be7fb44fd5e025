"""How much of a report the page shows, so that it opens at once however long the run was."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Limits:
    """What is shown whole."""

    items: int = 400
    """Of a long list: requirements, failures, measured quantities."""
    few: int = 40
    """Of a list that is short as a rule: the results of one requirement, complaints, reasons."""
    characters: int = 8_000
    """Of a transcript."""

    @property
    def sentence(self) -> int:
        """Characters of what is meant to be a sentence or a command."""
        return max(self.characters // 4, 4)

    def half(self) -> "Limits":
        """For a page that was too large."""
        return Limits(max(self.items // 2, 1), max(self.few // 2, 1), max(self.characters // 2, 16))


class Truncated(NamedTuple, Generic[T]):
    """The first of a list, and how many more there are."""

    these: Sequence[T]
    more: int


def first(items: Sequence[T], most: int) -> Truncated[T]:
    """So many at most."""
    return Truncated(items[:most], max(0, len(items) - most))
