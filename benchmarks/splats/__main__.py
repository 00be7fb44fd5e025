"""What a picture of Gaussians costs on the processor, and how far it is from its definition.

`skips`: each thing that is not done because it would not be seen, alone, and all but it; processor
time of one thread, the error of the worst of 400 pixels beside the truth in float64. `growth`: with
Gaussians, pixels and layers. `floor`: every Gaussian at every pixel, by the same loops. `served`:
through the whole path, a server and a client in processes of their own.

    python -m benchmarks splats [--rounds 7] [--only served]

writes `benchmarks/results/splats.json` and `splats.png`; `--only` renews one part of them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks.splats import growth, picture, served, skipping

RESULTS = Path(__file__).resolve().parents[1] / "results"
PARTS: dict[str, Callable[[int], Any]] = {
    "skips": skipping.measure,
    "growth": growth.measure,
    "floor": growth.beside_floor,
    "served": served.measure,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", choices=PARTS, action="append")
    options = parser.parse_args()
    path = RESULTS / "splats.json"
    figures = json.loads(path.read_text("utf-8")) if options.only and path.is_file() else {}
    figures |= {
        "command": f"python -m benchmarks splats --rounds {options.rounds}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
    }
    for name in options.only or PARTS:
        figures[name] = PARTS[name](options.rounds)
        path.write_text(json.dumps(figures, indent=1) + "\n", "utf-8")
    picture.draw(figures, RESULTS / "splats.png")


if __name__ == "__main__":
    main()
