"""How long does each numeric step take, and how far off is it? In several variants.

    python -m benchmarks accuracy [STEP ...] [--effort 1.0] [--draw]

measures the steps named, or all, and writes `benchmarks/results/accuracy/STEP.json` and `.png`,
and the tables of `benchmarks/ACCURACY.md`. `--draw` only draws again what is stored.
"""

from __future__ import annotations

import argparse
import importlib
import os
import platform
from dataclasses import asdict
from typing import Any

import numpy as np

from benchmarks.accuracy import page, picture, stored
from benchmarks.accuracy.study import Part, Study
from benchmarks.accuracy.timing import times

STEPS = ("rotation", "view", "chain", "depth", "compositing", "printing", "parsing", "scene")


def measured(part: Part, rounds: int, known: list[Any]) -> dict[str, Any]:
    """Times first, then errors: the search leaves a machine that is warm and a cache that is not.

    Args:
        part: of a study.
        rounds: of timing.
        known: the worst inputs that were found before, for whichever variant.
    """
    works = [part.run(variant.compute) for variant in part.variants]
    timings = times(part.floor, works, part.items, rounds)
    variants = []
    for variant, timing in zip(part.variants, timings, strict=True):
        found = part.worst(variant, known)
        variants.append(
            {
                "name": variant.name,
                "role": variant.role,
                "unlike": variant.unlike,
                "ratio": [round(r, 4) for r in timing[:3]],
                "ns": round(timing.best_ns, 3),
                "errors": [{"worst": worst.error, "input": worst.input} for worst in found],
            }
        )
        errors = ", ".join(f"{worst.error:.3g}" for worst in found)
        print(f"  {variant.name}: {timing.median:.3g} × floor, error {errors}", flush=True)
    return {
        "title": part.title,
        "item": part.item,
        "floor": part.floor_title,
        "measures": [asdict(measure) for measure in part.measures],
        "variants": variants,
    }


def report(name: str, study: Study, effort: float) -> dict[str, Any]:
    known = stored.worst_inputs(name)
    rounds = max(3, round(study.rounds * effort))
    parts = []
    for index, part in enumerate(study.parts):
        print(f"{study.title} {part.title}", flush=True)
        parts.append(measured(part, rounds, known[index] if index < len(known) else []))
    return {
        "command": f"python -m benchmarks accuracy {name} --effort {effort:g}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": f"{platform.system()} {platform.machine()}",
        "cpu_count": os.cpu_count(),
        "title": study.title,
        "parts": parts,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("steps", nargs="*", choices=[*STEPS, []], metavar="STEP", default=[])
    parser.add_argument("--effort", type=float, default=1.0, help="rounds of timing, times this")
    parser.add_argument("--draw", action="store_true", help="only draw what is stored")
    options = parser.parse_args()
    for name in options.steps or STEPS:
        if not options.draw:
            study = importlib.import_module(f"benchmarks.accuracy.{name}").study()
            stored.write(name, report(name, study, options.effort))
        picture.draw(stored.read(name), stored.RESULTS / f"{name}.png")
    page.update({name: stored.read(name) for name in STEPS if stored.exists(name)})


if __name__ == "__main__":
    main()
