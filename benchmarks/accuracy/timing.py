"""Times as ratios: every variant runs beside the floor, turn about, in every round.

What is counted is the processor time of this process, where the system counts it finely: so the
ratios hold on a machine that others use too.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

Work = Callable[[], object]
CLOCK = (
    time.process_time
    if time.get_clock_info("process_time").resolution < 1e-6
    else time.perf_counter
)


class Timing(NamedTuple):
    """How long one variant took.

    Attributes:
        low: a quarter of the rounds had a lower ratio to the floor.
        median: half of them.
        high: three quarters.
        best_ns: nanoseconds an item in the fastest round, the floor's share included.
    """

    low: float
    median: float
    high: float
    best_ns: float


def each(function: Callable[[Any], Any], items: Sequence[Any]) -> Work:
    """A call that computes all items, one after the other, and drops the results."""

    def work() -> None:
        for item in items:
            function(item)

    return work


def times(floor: Work, works: Sequence[Work], items: int, rounds: int) -> list[Timing]:
    """Timings of all works; the floor runs just before each, so that both see the same machine."""
    seconds: list[list[float]] = [[] for _ in works]
    ratios: list[list[float]] = [[] for _ in works]
    for work in (floor, *works):
        work()
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for index, work in enumerate(works):
                least = _seconds(floor)
                taken = _seconds(work)
                seconds[index].append(taken)
                ratios[index].append(taken / least)
    finally:
        gc.enable()
    return [
        Timing(*quartiles(ratio), min(taken) / items * 1e9)
        for ratio, taken in zip(ratios, seconds, strict=True)
    ]


def quartiles(values: Iterable[float]) -> tuple[float, float, float]:
    low, median, high = statistics.quantiles(values, n=4, method="inclusive")
    return low, median, high


def _seconds(work: Work) -> float:
    start = CLOCK()
    work()
    return CLOCK() - start
