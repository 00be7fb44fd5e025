"""Which variants nothing beats: the Pareto front of time and error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

LIKE = 1.1
"""Errors found by search are lower bounds; within this factor they count as alike."""


class Point(NamedTuple):
    """A variant in one picture; low ≤ time ≤ high is its ratio to the floor and its quartiles."""

    low: float
    time: float
    high: float
    error: float


def beats(a: Point, b: Point) -> bool:
    """Whether a is no worse than b in either, and better in one by more than the noise."""
    if a.time > b.time or a.error > b.error:
        return False
    return a.high < b.low or a.error * LIKE < b.error


def front(points: Sequence[Point]) -> list[int]:
    """The indices of the points that no other beats."""
    return [i for i, b in enumerate(points) if not any(beats(a, b) for a in points)]


def points_of(part: dict[str, Any], measure: int) -> list[Point]:
    """The variants of a stored part in the picture of one of its measures."""
    return [
        Point._make((*variant["ratio"], variant["errors"][measure]["worst"]))
        for variant in part["variants"]
    ]


def on_front(part: dict[str, Any], measure: int) -> list[int]:
    """The variants of a stored part that nothing that does the same job beats."""
    judged = [i for i, variant in enumerate(part["variants"]) if not variant["unlike"]]
    points = points_of(part, measure)
    return [judged[i] for i in front([points[i] for i in judged])]
