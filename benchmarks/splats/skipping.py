"""What each skip gains and costs: exact ones alone, others beside all exact ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from splatbus_splats.drawing.skips import EXACT, NOTHING, Skip

from benchmarks import _shared
from benchmarks.splats import drawn, scenes

LOSSY = (Skip.MOVING, Skip.SMALL)


def choices() -> Iterator[tuple[str, Skip]]:
    """Which skips are tried together, by what they are called."""
    yield "none", NOTHING
    for each in EXACT:
        yield f"only {name(each)}", each
    yield "exact", EXACT
    for each in LOSSY:
        yield f"exact, {name(each)}", EXACT | each


def name(skip: Skip) -> str:
    """As the command has it."""
    return str(skip.name).lower()


def measure(rounds: int) -> list[dict[str, Any]]:
    """A row for each scene and choice: milliseconds, their ratio to no skip, error."""
    rows = []
    for shot in scenes.shots():
        right, floor = drawn.truth(shot), 0.0
        for called, skips in choices():
            taken = drawn.cost(shot, skips, rounds)
            floor = floor or taken[1]
            row = {
                "scene": shot.name,
                "skips": called,
                "ms": [round(each, 2) for each in taken],
                "ratio": round(floor / taken[1], 2),
                "error_255": round(255 * drawn.error(drawn.image(shot, skips), right), 5),
            }
            rows.append(_shared.told(row))
    return rows
