"""One picture a step: time to the right, error upwards, both logarithmic, the front as a stair."""

from __future__ import annotations

from typing import Any

from benchmarks import _shared
from benchmarks.accuracy.front import on_front, points_of

COLORS = {"default": "tab:blue", "deployed": "tab:red"}


def draw(report: dict[str, Any], name: str) -> None:
    """A panel for each measure of each part; variants are numbers, which the legend names."""
    shown = [(part, i) for part in report["parts"] for i in range(len(part["measures"]))]
    figure, axes = _shared.panels(len(shown), figsize=(9.5, 3.6 * len(shown)), squeeze=False)
    for axis, (part, measure) in zip(axes[:, 0], shown, strict=True):
        _panel(axis, part, measure)
    figure.suptitle(report["title"])
    _shared.save(figure, name)


def _panel(axis: Any, part: dict[str, Any], measure: int) -> None:
    about, points, best = (
        part["measures"][measure],
        points_of(part, measure),
        on_front(part, measure),
    )
    wanted = [point.error for point in points if point.error] + [about["budget"] or 1.0]
    zero = min(wanted) / 1000.0  # a logarithmic axis has none
    places = [point.error or zero for point in points]
    for number, (variant, point) in enumerate(zip(part["variants"], points, strict=True)):
        color = "tab:orange" if variant["unlike"] else "black" if number in best else "0.6"
        color = COLORS.get(variant["role"], color)
        axis.hlines(places[number], point.low, point.high, color, alpha=0.5)
        style = {"marker": f"${number + 1}$", "markersize": 9, "linestyle": "none"}
        axis.plot(point.time, places[number], color=color, label=variant["name"], **style)
    stair = sorted((points[i].time, places[i]) for i in best)
    axis.step(*zip(*stair, strict=True), where="post", color="black", linewidth=0.6)
    if about["budget"] is not None:
        label = f"budget {about['budget']:.3g} [{about['requirement']}]"
        axis.axhline(about["budget"] or zero, color="tab:green", linestyle="--", label=label)
    if zero in places:
        axis.axhspan(zero / 3.0, zero * 3.0, color="0.93", label="exactly 0")
    axis.set(xscale="log", yscale="log", title=f"{about['title']} {part['title']}")
    axis.set(
        xlabel=f"time for one {part['item']}, × {part['floor']}",
        ylabel=f"worst found, {about['unit']}",
    )
    axis.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
