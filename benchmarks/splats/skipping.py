"""What each skip gains and costs: alone, and as the one that is missing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from splatbus_splats.drawing.skips import EXACT, NOTHING, Skip
from splatbus_splats.gaussians import halved

from benchmarks.splats import drawn, scenes
from benchmarks.splats.scenes import Shot

LOSSY = (Skip.HALVES, Skip.MOVING, Skip.FAR, Skip.SMALL)


def choices() -> Iterator[tuple[str, Skip]]:
    """Which skips are tried together, by what they are called."""
    yield "none", NOTHING
    for each in EXACT:
        yield f"only {name(each)}", each
    yield "exact", EXACT
    for each in EXACT:
        yield f"exact, not {name(each)}", EXACT & ~each
    for each in LOSSY:
        yield f"exact, {name(each)}", EXACT | each
    yield "all", ~NOTHING


def name(skip: Skip) -> str:
    """As the command has it."""
    return str(skip.name).lower()


def measure(rounds: int) -> list[dict[str, Any]]:
    """A row for each scene and choice: milliseconds, their ratio to no skip, error."""
    rows = []
    for shot in scenes.shots():
        right, floor = drawn.truth(shot), None
        for called, skips in choices():
            is_half = Skip.HALVES in skips
            chosen = in_halves(shot) if is_half else shot
            taken = drawn.cost(chosen, skips, rounds)
            floor = floor or taken
            row = {
                "scene": shot.name,
                "gaussians": shot.count,
                "skips": called,
                "ms": [round(each, 2) for each in taken],
                "ratio": round(floor.usual / taken.usual, 2),
                "error_255": round(255 * drawn.error(drawn.image(chosen, skips), right), 5),
            }
            print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
            rows.append(row)
    return rows


def in_halves(shot: Shot) -> Shot:
    """The same with its harmonics in float16."""
    return shot._replace(objects={k: halved(each) for k, each in shot.objects.items()})
