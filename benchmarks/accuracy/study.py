"""What a study consists of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

Role = Literal["default", "deployed", ""]


@dataclass(frozen=True)
class Variant:
    """One way to compute a step.

    Attributes:
        name: as it stands in pictures and tables.
        compute: what is timed; its arguments and results are the part's affair.
        role: "default" is what the code does by itself, "deployed" what the deployed program does.
        unlike: why it does not do the same job, so that it cannot push others off the front.
        slow: it takes so long that the search tries a hundredth of the inputs.
    """

    name: str
    compute: Callable[..., Any]
    role: Role = ""
    unlike: str = ""
    slow: bool = False

    @property
    def effort(self) -> float:
        return 0.01 if self.slow else 1.0


@dataclass(frozen=True)
class Measure:
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
class Part:
    """Variants that compute the same thing from the same items.

    Attributes:
        title: what distinguishes this part within its study; "" where there is one.
        item: what a time is given for, as "pose".
        items: how many of them one run computes.
        floor_title: what the floor does.
        floor: does it, for all items.
        run: a variant's function to a call that computes all items.
        worst: a variant, and bad inputs that are known, to the worst by measure.
        variants: in the order of tables.
        measures: a panel for each.
    """

    item: str
    items: int
    floor_title: str
    floor: Callable[[], object]
    run: Callable[[Callable[..., Any]], Callable[[], object]]
    worst: Callable[[Variant, Sequence[Any]], list[Worst]]
    variants: tuple[Variant, ...]
    measures: tuple[Measure, ...]
    title: str = ""


@dataclass(frozen=True)
class Study:
    """One numeric step.

    Attributes:
        title: above its picture.
        parts: each timed by itself.
        rounds: in each of which every variant runs once.
    """

    title: str
    parts: list[Part] = field(default_factory=list)
    rounds: int = 40
