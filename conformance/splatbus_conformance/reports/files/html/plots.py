"""Plots as paths: what SVG draws, reckoned from numbers. The template puts them on the page."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

WIDTH, HEIGHT = 320, 72
"""Of a histogram, in units of its viewBox."""
ROW_WIDTH, ROW_HEIGHT = 200, 16
MOST_DECADES = 12


class Tick(NamedTuple):
    """A mark on an axis."""

    x: float
    label: str


class Decades(NamedTuple):
    """A logarithmic axis between two powers of ten."""

    low: int
    high: int

    def x(self, value: float, width: float = WIDTH) -> float:
        """Where a value stands; one beyond an end at that end."""
        if value <= 0:
            return 0.0
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return round(width * min(max(share, 0.0), 1.0), 2)

    def ticks(self) -> list[Tick]:
        """A mark at each power of ten, labelled as a duration where there is room for it."""
        step = 1 + (self.high - self.low) // 6
        return [
            Tick(self.x(10.0**power), duration(10.0**power) if place % step == 0 else "")
            for place, power in enumerate(range(self.low, self.high + 1))
        ]


ROW = Decades(-4, 1)
"""Of a row of errors, by their budgets: what is smaller or larger stands at an end."""
AT_BUDGET = ROW.x(1.0, ROW_WIDTH)


def decades_around(values: Iterable[float]) -> Decades:
    """The axis that holds these positive values."""
    logarithms = [math.log10(value) for value in values if 0 < value < math.inf] or [0.0]
    low, high = math.floor(min(logarithms)), math.ceil(max(logarithms))
    return Decades(max(low, high - MOST_DECADES), max(high, low + 1))


def bars(bins: Sequence[tuple[float, float, int]], axis: Decades) -> str:
    """The path of a histogram's bars, the highest as high as the plot."""
    most = max((count for _, _, count in bins), default=1)
    drawn = []
    for low, high, count in bins:
        left, right = axis.x(low), axis.x(high)
        # One answer among thousands is a finding too: no bar is lower than can be seen.
        top = round(HEIGHT - max(HEIGHT * count / most, 1.5), 2)
        drawn.append(f"M{left:g} {HEIGHT}V{top:g}H{max(right, left + 0.8):g}V{HEIGHT}z")
    return "".join(drawn)


def of_budget(worst: float | None, budget: float) -> float:
    """Where an error stands in a row: each step is a factor of ten, and the budget has its place.

    None is an error that is not finite. With a budget of 0, any error is beyond it.
    """
    if worst == 0:
        return 0.0
    if worst is None or budget <= 0:
        return float(ROW_WIDTH)
    return ROW.x(worst / budget, ROW_WIDTH)


def row_ticks() -> list[float]:
    """Where the powers of ten stand in a row."""
    return [ROW.x(10.0**power, ROW_WIDTH) for power in range(ROW.low, ROW.high + 1)]


def against(worst: float | None, budget: float) -> str:
    """An error and its budget, compared in words."""
    if worst is None:
        return "not finite"
    if worst == 0:
        return "exact"
    if budget <= 0:
        return "over budget: it had to be exact"
    ratio = worst / budget
    if ratio > 1:
        return f"{digits(ratio)} times the budget"
    return f"{digits(100 * ratio)}% of the budget" if ratio >= 1e-4 else "far below the budget"


def duration(seconds: float) -> str:
    """For people: three digits, in the unit that fits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size * 0.9995:
            return f"{digits(seconds / size)} {unit}"
    return f"{digits(seconds / 1e-6)} µs"


def digits(number: float) -> str:
    """A number with three digits, or more where they are all of a whole one."""
    if 1000 <= abs(number) < 1e6:
        return f"{number:,.0f}"
    mantissa, e, exponent = f"{number:.3g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if e else mantissa
