"""The stored results, and what follows from them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.accuracy.front import Point

RESULTS = Path(__file__).parents[1] / "results" / "accuracy"


def path(name: str) -> Path:
    return RESULTS / f"{name}.json"


def exists(name: str) -> bool:
    return path(name).exists()


def read(name: str) -> Any:
    return json.loads(path(name).read_text("utf-8"))


def write(name: str, report: dict[str, Any]) -> None:
    RESULTS.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False)
    path(name).write_text(text + "\n", "utf-8")


def worst_inputs(name: str) -> list[list[Any]]:
    """For each part, the worst inputs that were found before, for whichever variant."""
    if not exists(name):
        return []
    return [
        [
            error["input"]
            for variant in part["variants"]
            for error in variant["errors"]
            if error["input"] is not None
        ]
        for part in read(name)["parts"]
    ]


def points(part: dict[str, Any], measure: int) -> list[Point]:
    """The variants of a part in the picture of one of its measures."""
    return [
        Point(low, time, high, variant["errors"][measure]["worst"])
        for variant in part["variants"]
        for low, time, high in [variant["ratio"]]
    ]


def judged(part: dict[str, Any]) -> list[int]:
    """The indices of the variants that do the same job."""
    return [i for i, variant in enumerate(part["variants"]) if not variant["unlike"]]
