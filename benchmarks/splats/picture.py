"""The figures as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks._pictures import pyplot, save
from benchmarks.accuracy.front import Point, front

ROUNDING = 1e-5
"""Errors below this, of 255, are drawn as this: there is no zero on a scale of powers."""
LABELS = {"gaussians": "Gaussians, 640×480", "pixels": "pixels, 100,000", "layers": "layers"}


def draw(figures: dict[str, Any], path: Path) -> None:
    """Time against error for each scene, and growth."""
    plt = pyplot()
    names = list(dict.fromkeys(row["scene"] for row in figures["skips"]))
    figure, axes = plt.subplots(2, 5, figsize=(20, 8))
    places = iter(axes.flat)
    for name in names:
        _scene(next(places), name, [row for row in figures["skips"] if row["scene"] == name])
    for by, label in LABELS.items():
        _growth(next(places), label, [row for row in figures["growth"] if row["by"] == by])
    figure.tight_layout()
    save(figure, path, 80)


def _scene(axis: Any, name: str, rows: list[dict[str, Any]]) -> None:
    errors = [max(row["error_255"], ROUNDING) for row in rows]
    points = [Point(*row["ms"], error) for row, error in zip(rows, errors, strict=True)]
    best = set(front(points))
    for i, (row, point) in enumerate(zip(rows, points, strict=True)):
        is_base = row["skips"] in ("none", "exact")
        color = "C3" if i in best else ("C0" if is_base else "0.6")
        axis.plot(point.time, point.error, "o", color=color, markersize=7 if i in best else 5)
    marked = sorted(best | {i for i, row in enumerate(rows) if row["skips"] in ("none", "exact")})
    for turn, i in enumerate(sorted(marked, key=lambda i: points[i].time)):
        axis.annotate(
            rows[i]["skips"].replace("exact, ", "+"),
            (points[i].time, points[i].error),
            xytext=(3, 6 + 9 * (turn % 4)),
            textcoords="offset points",
            fontsize=7,
        )
    axis.axhline(1.0, color="0.5", linestyle=":", linewidth=1)
    axis.set(xscale="log", yscale="log", ylim=(ROUNDING / 3, 600))
    axis.tick_params(axis="x", which="both", labelsize=6, labelrotation=60)
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("{x:g}")
    axis.set_title(f"{name} ({rows[0]['gaussians']:,})", fontsize=10)
    axis.set_xlabel("processor time, ms", fontsize=8)
    axis.set_ylabel("worst pixel, of 255", fontsize=8)


def _growth(axis: Any, label: str, rows: list[dict[str, Any]]) -> None:
    for key, called in (("ms_without_skips", "no skip"), ("ms", "exact skips")):
        axis.plot([row["x"] for row in rows], [row[key] for row in rows], "o-", label=called)
    axis.set(xscale="log", yscale="log")
    axis.set_xlabel(label, fontsize=8)
    axis.set_ylabel("processor time, ms", fontsize=8)
    axis.legend(fontsize=8)
