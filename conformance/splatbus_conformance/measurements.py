"""How far off a testee was: the worst case of each quantity, with its budget and its input."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Measurement:
    """The worst error of one quantity over all cases of a check."""

    quantity: str
    worst: float
    budget: float | None
    """None for what no clause limits: it is told for people to know."""
    unit: str
    input: str
    """The case that was worst."""
    cases: int
    beyond: int
    """Cases beyond the budget."""

    def __str__(self) -> str:
        of = "" if self.budget is None else f" of {self.budget:g}"
        at = f" at {self.input}" if self.worst else ""
        return f"{self.quantity}: worst {self.worst:.3g} {self.unit}{of} in {self.cases} cases{at}"

    def as_json(self) -> dict[str, Any]:
        """For reports; an error that is not finite is null."""
        return {
            "quantity": self.quantity,
            "worst": self.worst if math.isfinite(self.worst) else None,
            "budget": self.budget,
            "unit": self.unit,
            "input": self.input,
            "cases": self.cases,
            "beyond": self.beyond,
        }


class Measurements:
    """Errors as they are measured; keeps the worst of each quantity."""

    def __init__(self) -> None:
        self._worst: dict[str, Measurement] = {}
        self._newest: dict[str, float] = {}

    def add(self, quantity: str, error: float, budget: float | None, unit: str, input: str) -> None:
        """Take one more case."""
        if budget is not None:
            self._newest[quantity] = max(error, self._newest.get(quantity, error))
        former = self._worst.get(quantity)
        cases = 1 + (former.cases if former else 0)
        over = budget is not None and not error <= budget
        beyond = over + (former.beyond if former else 0)
        if former and not error > former.worst:
            error, input = former.worst, former.input
        self._worst[quantity] = Measurement(quantity, error, budget, unit, input, cases, beyond)

    def newest(self) -> dict[str, float]:
        """The largest errors since this was asked last, of what has a budget: a search climbs on
        them.
        """
        newest, self._newest = self._newest, {}
        return newest

    def beyond(self) -> list[Measurement]:
        """What passed its budget."""
        return [it for it in self if it.beyond]

    def __iter__(self) -> Iterator[Measurement]:
        return iter(self._worst.values())
