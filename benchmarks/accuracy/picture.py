"""One picture a step: time to the right, error upwards, both logarithmic, the front as a stair.

A logarithmic axis has no zero. Errors of exactly 0 stand in a strip of their own at the bottom,
set off by a gap in the scale, whose tick reads 0.
"""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks._pictures import pyplot, save
from benchmarks.accuracy import labels, stored
from benchmarks.accuracy.front import Point, front

INK, FAINT, GRID = "#1f2328", "#7d8590", "#e4e7eb"
DEFAULT, DEPLOYED, FRONT, BUDGET = "#0b5cad", "#c4421a", "#3d444d", "#1a7f37"
BEATEN, KEPT = "#f3f4f6", "#effaf2"
PANEL_INCHES = 4.3
WIDE, NARROW = 6.4, 5.2
NEAR_TIME, NEAR_ERROR = 4.0, 25.0
"""How far from the default, by what factor, a point may lie to be in the enlarged picture."""


class Scale(NamedTuple):
    """The vertical axis: from low to high, and where an error of 0 stands, if there is one."""

    low: float
    high: float
    zero: float | None

    def place(self, error: float) -> float:
        return error if error > 0 or self.zero is None else self.zero


def draw(report: dict[str, Any], path: Path) -> None:
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    plt = pyplot()
    rows = [(part, i) for part in report["parts"] for i in range(len(part["measures"]))]
    near = [neighbours(part, i) for part, i in rows]
    width = WIDE + NARROW if any(near) else WIDE + 3.0
    size = (width, PANEL_INCHES * len(rows) + 0.6)
    with plt.rc_context({"font.size": 10, "font.family": "DejaVu Sans", "text.color": INK}):
        figure = plt.figure(
            figsize=size, facecolor="white", layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.1)
        )
        figure.suptitle(report["title"], x=0.012, ha="left", fontsize=14, fontweight="bold")
        grid = figure.add_gridspec(len(rows), 2, width_ratios=(WIDE, NARROW))
        drawn = []
        for row, ((part, measure), close) in enumerate(zip(rows, near, strict=True)):
            axis = figure.add_subplot(grid[row, 0] if close else grid[row, :])
            drawn.append(Panel(axis, part, measure, set(range(len(part["variants"])))))
            if close:
                drawn[-1] = drawn[-1]._replace(named=drawn[-1].named - close)
                drawn.append(Panel(figure.add_subplot(grid[row, 1]), part, measure, close, True))
        for panel in drawn:
            fill(panel)
        for everything, enlarged in pairwise(drawn):
            if enlarged.enlarged:
                frame(everything, enlarged)
        figure.supxlabel(notes(report), x=0.012, ha="left", fontsize=9, color=FAINT)
        figure.canvas.draw()
        for panel in drawn:
            name(panel)
        save(figure, path, 100)
        plt.close(figure)


def notes(report: dict[str, Any]) -> str:
    """What the floor does, and why some points are hollow."""
    lines = [f"floor: {report['parts'][0]['floor']}"]
    others: dict[str, list[str]] = {}
    for variant in report["parts"][0]["variants"]:
        if variant["unlike"]:
            others.setdefault(variant["unlike"], []).append(variant["name"])
    lines += [f"○ {', '.join(names)}: {reason}" for reason, names in others.items()]
    return "\n".join(lines)


class Panel(NamedTuple):
    """One measure of a part, all of it or enlarged about the default; and the points it names."""

    axis: Any
    part: dict[str, Any]
    measure: int
    named: set[int]
    enlarged: bool = False

    @property
    def about(self) -> Any:
        return self.part["measures"][self.measure]

    @property
    def points(self) -> list[Point]:
        return stored.points(self.part, self.measure)

    def shown(self) -> list[Point]:
        return [self.points[i] for i in self.named] if self.enlarged else self.points

    def scale(self) -> Scale:
        return scale_of([point.error for point in self.shown()], self.budget())

    def budget(self) -> float | None:
        """The budget, unless it is far from everything in an enlarged picture."""
        budget: float | None = self.about["budget"]
        if budget and self.enlarged:
            errors = [point.error for point in self.shown()]
            if not min(errors) / NEAR_ERROR <= budget <= max(errors) * NEAR_ERROR:
                return None
        return budget

    def span(self) -> tuple[float, float]:
        """The horizontal axis."""
        room = 1.15 if self.enlarged else 1.3
        left = min(point.low for point in self.shown())
        right = max(point.high for point in self.shown())
        return left / room, right * max(room, (right / left) ** 0.25)

    def stair(self) -> list[tuple[float, float]]:
        judged = [self.points[i] for i in stored.judged(self.part)]
        return corners(self.scale(), judged, self.span()[1])

    def lines(self) -> list[labels.Segment]:
        """What a name should not cross: the stair, the budget, the spread of the times."""
        scale, (left, right) = self.scale(), self.span()
        lines = list(pairwise(self.stair()))
        for point in self.points:
            y = scale.place(point.error)
            lines.append(((point.low, y), (point.high, y)))
        if (budget := self.budget()) is not None:
            y = scale.place(budget)
            lines.append(((left, y), (right, y)))
        return lines


def neighbours(part: dict[str, Any], measure: int) -> set[int]:
    """The variants about the default, where they would be on top of each other."""
    points = stored.points(part, measure)
    (center,) = (
        point
        for point, variant in zip(points, part["variants"], strict=True)
        if variant["role"] == "default"
    )
    if center.error == 0.0:
        return set()
    close = {
        i
        for i, point in enumerate(points)
        if max(point.time / center.time, center.time / point.time) <= NEAR_TIME
        and point.error > 0
        and max(point.error / center.error, center.error / point.error) <= NEAR_ERROR
    }
    errors = [point.error for point in points if point.error > 0]
    crowded = len(close) >= 3 and max(errors) / min(errors) > NEAR_ERROR**2
    return close if crowded else set()


def fill(panel: Panel) -> None:
    """All but the names of the points."""
    axis, about, scale = panel.axis, panel.about, panel.scale()
    left, right = panel.span()
    axis.set(xscale="log", yscale="log", xlim=(left, right), ylim=(scale.low, scale.high))
    for side in ("top", "right"):
        axis.spines[side].set_visible(panel.enlarged)
    for spine in axis.spines.values():
        spine.set_color(FAINT)
    axis.grid(True, which="major", color=GRID, linewidth=0.8)
    axis.set_axisbelow(True)
    axis.tick_params(colors=INK, which="both", length=3, labelsize=9)
    title = f"{about['title']}, {panel.part['title']}" if panel.part["title"] else about["title"]
    if panel.enlarged:
        title = "About the default"
    axis.set_title(title, loc="left", fontsize=11)
    if not panel.enlarged:
        axis.set_ylabel(f"worst error found, {about['unit']}")
        axis.set_xlabel(f"time for a {panel.part['item']}, × floor")
    else:
        axis.set_xlabel("time, as on the left")
    ticks(axis, scale, left, right)
    if scale.zero is not None:
        zero_strip(axis, scale)
    if panel.budget() is not None:
        budget(axis, scale, about)
    draw_stair(axis, scale, panel.stair())
    on = on_front(panel.part, panel.measure)
    variants = panel.part["variants"]
    for index in sorted(
        range(len(variants)), key=lambda i: (variants[i]["role"] == "default", i in on)
    ):
        variant, point = variants[index], panel.points[index]
        dot(axis, variant, point, scale.place(point.error), index in on)


def frame(everything: Panel, enlarged: Panel) -> None:
    """What is enlarged, in the picture of everything."""
    left, right = enlarged.span()
    scale = enlarged.scale()
    everything.axis.plot(
        (left, right, right, left, left),
        (scale.low, scale.low, scale.high, scale.high, scale.low),
        color=FAINT, linewidth=0.9, zorder=2.5,
    )  # fmt: skip
    everything.axis.annotate(
        "enlarged on the right", (right, scale.high), xytext=(0, 3), textcoords="offset points",
        ha="right", va="bottom", fontsize=8, color=FAINT,
    )  # fmt: skip


def on_front(part: dict[str, Any], measure: int) -> set[int]:
    """The variants of a part that nothing that does the same job beats."""
    judged = stored.judged(part)
    points = stored.points(part, measure)
    return {judged[i] for i in front([points[i] for i in judged])}


def scale_of(errors: list[float], allowed: float | None) -> Scale:
    values = [*errors, *([] if allowed is None else [allowed])]
    positive = [value for value in values if value > 0] or [1.0]
    low, high = math.log10(min(positive)), math.log10(max(positive))
    room = max(0.12 * (high - low), 0.35)
    if all(value > 0 for value in values):
        return Scale(10 ** (low - room), 10 ** (high + room), None)
    return Scale(10 ** (low - 3.4 * room), 10 ** (high + room), 10 ** (low - 2.4 * room))


def ticks(axis: Any, scale: Scale, left: float, right: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    factors: tuple[float, ...] = (1,)
    if right / left < 2000:
        factors = (1, 2, 5) if right / left > 12 else (1, 1.2, 1.5, 2, 3, 4, 5, 7)
    decades = [
        factor * 10.0**exponent
        for exponent in range(math.floor(math.log10(left)), math.ceil(math.log10(right)) + 1)
        for factor in factors
    ]
    axis.xaxis.set_major_locator(FixedLocator([x for x in decades if left <= x <= right]))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"×{x:,.10g}"))
    bottom = scale.low if scale.zero is None else scale.zero**0.4 * scale.low**-0.4 * scale.zero
    first, last = math.ceil(math.log10(bottom)), math.floor(math.log10(scale.high))
    step = max(1, math.ceil((last - first) / 7))
    steps = (1, 2, 5) if last - first < 2 else (1,)
    places = [f * 10.0**e for e in range(first - 1, last + 1, step) for f in steps]
    places = [y for y in places if bottom <= y <= scale.high]
    names = [_number(y) for y in places]
    if scale.zero is not None:
        places, names = [scale.zero, *places], ["0", *names]
    axis.set_yticks(places, names)
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_minor_formatter(NullFormatter())


def _number(value: float) -> str:
    exponent = math.floor(math.log10(value) + 1e-9)
    if -3 <= exponent <= 3:
        return f"{value:g}"
    mantissa = round(value / 10.0**exponent)
    power = f"10$^{{{exponent}}}$"
    return power if mantissa == 1 else f"{mantissa}·{power}"


def zero_strip(axis: Any, scale: Scale) -> None:
    assert scale.zero is not None
    top = scale.zero * (scale.zero / scale.low) ** 0.7
    axis.axhspan(scale.low, top, color="#f6f3e9", zorder=0, linewidth=0)
    axis.axhline(top, color="white", linewidth=5, zorder=1)
    axis.text(
        0.006, scale.low, "below the gap: exactly 0", transform=axis.get_yaxis_transform(),
        ha="left", va="bottom", fontsize=8, color=FAINT,
    )  # fmt: skip


def budget(axis: Any, scale: Scale, about: dict[str, Any]) -> None:
    allowed = about["budget"]
    line = scale.place(allowed)
    axis.axhline(line, color=BUDGET, linewidth=1.2, linestyle=(0, (5, 3)), zorder=2)
    value = "0" if allowed == 0 else f"{allowed:.3g}"
    axis.text(
        0.994, line, f"budget {value} [{about['requirement']}]",
        transform=axis.get_yaxis_transform(), ha="right", va="bottom", fontsize=9, color=BUDGET,
    )  # fmt: skip


def corners(scale: Scale, points: list[Point], right: float) -> list[tuple[float, float]]:
    """The stair of what is not beaten, from the top to the right."""
    best = sorted((points[i].time, scale.place(points[i].error)) for i in front(points))
    stair = [(best[0][0], scale.high)]
    for time, error in best:
        if error < stair[-1][1]:
            stair += [(time, stair[-1][1]), (time, error)]
    return [*stair, (right, stair[-1][1])]


def draw_stair(axis: Any, scale: Scale, stair: list[tuple[float, float]]) -> None:
    """What lies above and right of it is beaten."""
    xs, ys = zip(*stair, strict=True)
    axis.fill_between(xs, ys, scale.high, color=BEATEN, zorder=0.5, linewidth=0)
    axis.plot(xs, ys, color=FRONT, linewidth=1.3, alpha=0.7, zorder=2)


def dot(axis: Any, variant: dict[str, Any], point: Point, y: float, on: bool) -> None:
    color = {"default": DEFAULT, "deployed": DEPLOYED}.get(variant["role"], FRONT if on else FAINT)
    hollow = bool(variant["unlike"])
    axis.plot((point.low, point.high), (y, y), color=color, linewidth=2.2, alpha=0.5, zorder=3)
    axis.plot(
        point.time, y, zorder=4, linestyle="none",
        marker="D" if variant["role"] == "deployed" else "o",
        markersize={"default": 11, "deployed": 8.5}.get(variant["role"], 7),
        markerfacecolor="white" if hollow else color,
        markeredgecolor=color if hollow else "white", markeredgewidth=1.4 if hollow else 1.0,
    )  # fmt: skip


def name(panel: Panel) -> None:
    on = on_front(panel.part, panel.measure)
    scale = panel.scale()
    wanted = []
    for index in sorted(panel.named):
        variant, point = panel.part["variants"][index], panel.points[index]
        role = variant["role"]
        color = {"default": DEFAULT, "deployed": DEPLOYED}.get(role, INK if index in on else FAINT)
        place = scale.place(point.error)
        wanted.append(
            labels.Label(variant["name"], point.time, place, color, bool(role), bool(role))
        )
    labels.place(panel.axis, wanted, panel.lines())
