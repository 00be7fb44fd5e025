"""The tables of `benchmarks/ACCURACY.md`, from the stored results, between its markers."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from benchmarks import _shared
from benchmarks.accuracy.front import on_front

PAGE = Path(__file__).parents[1] / "ACCURACY.md"
MARKED = re.compile(r"(<!-- figures: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def stored(name: str) -> Any:
    """What was measured of a step."""
    return json.loads((_shared.RESULTS / "accuracy" / f"{name}.json").read_text("utf-8"))


def filled(text: str) -> str:
    """The page with its tables."""

    def table(found: re.Match[str]) -> str:
        parts = "\n".join(table_of(part) for part in stored(found[2])["parts"])
        return f"{found[1]}{parts}\n{found[3]}"

    return MARKED.sub(table, text)


def table_of(part: dict[str, Any]) -> str:
    heads = [f"{m['title']} ({m['unit']})" for m in part["measures"]]
    budgets = [_budget(m) for m in part["measures"]]
    rows = [
        ["variant", f"× floor, {part['title'] or 'quartiles'}", f"ns a {part['item']}", *heads],
        ["---", "---:", "---:", *["---:"] * len(heads)],
    ]
    fronts = [on_front(part, i) for i in range(len(heads))]
    for index, variant in enumerate(part["variants"]):
        low, median, high = variant["ratio"]
        name = f"**{variant['name']}**" if variant["role"] else variant["name"]
        if variant["unlike"]:
            name += f" *({variant['unlike']})*"
        errors = [
            f"{_error(e['worst'])}{' ◂' if index in on else ''}"
            for e, on in zip(variant["errors"], fronts, strict=True)
        ]
        rows.append(
            [name, f"{median:.3g} ({low:.3g}–{high:.3g})", f"{variant['ns']:,.3g}", *errors]
        )
    rows.append(["*budget*", "", "", *budgets])
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows) + "\n"


def _error(value: float) -> str:
    return "0" if value == 0 else f"{value:.3g}"


def _budget(measure: dict[str, Any]) -> str:
    if measure["budget"] is None:
        return "–"
    return f"*{measure['budget']:.3g} [{measure['requirement']}]*"
