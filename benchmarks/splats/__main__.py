"""What a picture of Gaussians costs on the processor, and how far it is from its definition.

`skips`: each thing that is not done because it would not be seen; processor time of one thread, the
error of the worst of 400 pixels beside the truth in float64. `floor`: every Gaussian at every
pixel, by the same loops. `served`: through the whole path, a server and a client in processes of
their own.

    python -m benchmarks splats [--rounds 7] [--only served]

`--only` renews one part of `benchmarks/results/splats.json`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import Any

import numba

from benchmarks import _shared
from benchmarks.accuracy import picture
from benchmarks.splats import brute, served, skipping

PARTS: dict[str, Callable[[int], Any]] = {
    "skips": skipping.measure,
    "floor": brute.measure,
    "served": served.measure,
}


def report(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """A part for each scene, as the studies of accuracy have them."""
    about = {"title": "Worst pixel", "unit": "of 255", "budget": 1.0, "requirement": "SPLATS.md"}
    parts: dict[str, Any] = {}
    for row in rows:
        part = {"title": row["scene"], "item": "image", "floor": "1 ms", "measures": [about]}
        errors = [{"worst": row["error_255"]}]
        found = {"name": row["skips"], "ratio": row["ms"], "errors": errors, "unlike": ""}
        role = "default" if row["skips"] == "exact" else ""
        parts.setdefault(row["scene"], part | {"variants": []})["variants"].append(
            found | {"role": role}
        )
    return {"title": "An image of Gaussians on the processor", "parts": list(parts.values())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", choices=PARTS, action="append")
    options = parser.parse_args()
    path = _shared.RESULTS / "splats.json"
    figures = json.loads(path.read_text("utf-8")) if options.only and path.is_file() else {}
    figures = {name: figures[name] for name in PARTS if name in figures}
    for name in options.only or PARTS:
        figures[name] = PARTS[name](options.rounds)
        _shared.write("splats", {"numba": numba.__version__, **figures})
    picture.draw(report(figures["skips"]), "splats")


if __name__ == "__main__":
    main()
