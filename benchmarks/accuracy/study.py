"""What a study of one numeric step consists of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from benchmarks._shared import Work

Role = Literal["default", "deployed", ""]
Compute = Callable[..., Any]


@dataclass(frozen=True)
class Variant:
    """One way to compute a step.

    Attributes:
        name: as it stands in pictures and tables.
        compute: what is timed; its arguments and results are the step's affair.
        role: "default" is what the code does by itself, "deployed" what the deployed program does.
        unlike: why it does not do the same job, so that it cannot push others off the front.
    """

    name: str
    compute: Compute
    role: Role = ""
    unlike: str = ""


class Measure(NamedTuple):
    """One kind of error.

    Attributes:
        title: what is off.
        unit: of the error, for the axis.
        budget: the greatest error allowed; None where the standard sets none.
        requirement: the clause that sets the budget.
    """

    title: str
    unit: str
    budget: float | None = None
    requirement: str = ""


class Worst(NamedTuple):
    """The greatest error that was found, and the input that gives it, as JSON."""

    error: float
    input: Any


@dataclass(frozen=True)
class Study:
    """Variants that compute the same thing from the same items.

    Attributes:
        title: above its picture.
        item: what a time is given for, as "pose".
        items: how many of them one run computes.
        floor_title: what the floor does.
        floor: does it, for all items.
        run: a variant's function to a call that computes all items.
        variants: in the order of tables.
        measures: a panel for each.
        worst: a variant's function, and bad inputs that are known, to the worst by measure.
        rounds: in each of which every variant runs once.
    """

    title: str
    item: str
    items: int
    floor_title: str
    floor: Work
    run: Callable[[Compute], Work]
    variants: tuple[Variant, ...]
    measures: tuple[Measure, ...]
    worst: Callable[[Compute, Sequence[Any]], list[Worst]]
    rounds: int = 40


def each(items: Sequence[Any], function: Compute) -> Work:
    """A call that computes all items, one after the other, and drops the results."""

    def work() -> None:
        for item in items:
            function(item)

    return work
