"""How long does each numeric step take, and how far off is it? In several variants.

    python -m benchmarks accuracy [STEP ...] [--effort 1.0] [--draw]

measures the steps named, or all, and writes `benchmarks/results/accuracy/STEP.json` and `.png`,
and the tables of `benchmarks/ACCURACY.md`. `--draw` only draws again what is stored.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence
from typing import Any

from benchmarks import _shared
from benchmarks.accuracy import page, picture
from benchmarks.accuracy.study import Study

STEPS = ("rotation", "view", "chain", "depth", "compositing", "printing", "parsing")


def measured(study: Study, effort: float, known: Sequence[Any]) -> dict[str, Any]:
    """Times first, then errors: the search leaves a machine that is warm and a cache that is not.

    Args:
        study: of a step.
        effort: of its rounds of timing.
        known: the worst inputs that were found before, for whichever variant.
    """
    works = [study.run(variant.compute) for variant in study.variants]
    rounds = max(3, round(study.rounds * effort))
    variants = []
    for variant, times in zip(
        study.variants, _shared.beside(study.floor, works, rounds), strict=True
    ):
        about: dict[str, Any] = {
            "name": variant.name,
            "role": variant.role,
            "unlike": variant.unlike,
        }
        about["ratio"] = [round(each, 4) for each in times.ratio()]
        about["ns"] = round(min(times.taken) / study.items * 1e6, 3)
        found = study.worst(variant.compute, known)
        about["errors"] = [{"worst": worst.error, "input": worst.input} for worst in found]
        variants.append(_shared.told(about))
    part = {
        "title": "",
        "item": study.item,
        "floor": study.floor_title,
        "measures": [measure._asdict() for measure in study.measures],
        "variants": variants,
    }
    return {"title": study.title, "parts": [part]}


def inputs(part: dict[str, Any]) -> list[Any]:
    """The worst inputs that are stored, for whichever variant."""
    errors = [error for variant in part["variants"] for error in variant["errors"]]
    return [error["input"] for error in errors if error["input"] is not None]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("steps", nargs="*", choices=[*STEPS, []], metavar="STEP", default=[])
    parser.add_argument("--effort", type=float, default=1.0, help="rounds of timing, times this")
    parser.add_argument("--draw", action="store_true", help="only draw what is stored")
    options = parser.parse_args()
    for name in options.steps or STEPS:
        if not options.draw:
            study = importlib.import_module(f"benchmarks.accuracy.{name}").study()
            known = inputs(page.stored(name)["parts"][0])
            report = measured(study, options.effort, known)
            _shared.write("accuracy", report, f"accuracy/{name}")
        picture.draw(page.stored(name), f"accuracy/{name}")
    page.PAGE.write_text(page.filled(page.PAGE.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main()
