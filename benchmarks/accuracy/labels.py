"""Names beside the points of a picture, where they cover neither points nor each other."""

from __future__ import annotations

from typing import Any, NamedTuple

Box = tuple[float, float, float, float]
GAP = 7.0
FAR = 90.0
DIRECTIONS = (
    ("left", "center", 1.0, 0.0), ("right", "center", -1.0, 0.0),
    ("left", "bottom", 0.75, 0.6), ("left", "top", 0.75, -0.6),
    ("right", "bottom", -0.75, 0.6), ("right", "top", -0.75, -0.6),
    ("center", "bottom", 0.0, 0.8), ("center", "top", 0.0, -0.8),
)  # fmt: skip


class Label(NamedTuple):
    """A name, the point that it belongs to, and whether it chooses its place before others."""

    text: str
    x: float
    y: float
    color: str
    bold: bool
    first: bool


Segment = tuple[tuple[float, float], tuple[float, float]]


def place(axis: Any, wanted: list[Label], lines: list[Segment]) -> None:
    """Writes the labels; a line leads to one that stands apart from its point.

    Args:
        axis: what it draws on.
        wanted: the labels.
        lines: horizontal or vertical ones, in the axis' numbers, that labels should not cross.
    """
    from matplotlib.patheffects import withStroke

    figure = axis.figure
    pixel = figure.dpi / 72
    renderer = figure.canvas.get_renderer()
    frame = axis.get_window_extent(renderer)
    inside = (frame.x0 + 2, frame.y0 + 2, frame.x1 - 2, frame.y1 - 2)
    points = [axis.transData.transform((each.x, each.y)) for each in wanted]
    taken = [_around(x, y, 7 * pixel) for x, y in points]
    taken += [text.get_window_extent(renderer).extents for text in axis.texts]
    for start, end in lines:
        (x0, y0), (x1, y1) = axis.transData.transform(start), axis.transData.transform(end)
        taken.append((min(x0, x1) - 2, min(y0, y1) - 2, max(x0, x1) + 2, max(y0, y1) + 2))
    for label, (x, y) in sorted(
        zip(wanted, points, strict=True), key=lambda pair: (not pair[0].first, -pair[1][1])
    ):
        text = axis.annotate(
            label.text, (label.x, label.y), xytext=(0, 0), textcoords="offset points",
            fontsize=9, color=label.color, fontweight="bold" if label.bold else "normal", zorder=6,
            path_effects=[withStroke(linewidth=2.5, foreground="white", alpha=0.8)],
        )  # fmt: skip
        size = text.get_window_extent(renderer)
        best = min(
            (
                (_cost(_box(x, y, size, way, reach * pixel), taken, inside) + reach, reach, way)
                for reach in (GAP, 14.0, 24.0, 38.0, 55.0, FAR)
                for way in DIRECTIONS
            ),
            key=lambda choice: choice[0],
        )
        _, reach, (ha, va, right, up) = best
        text.set(ha=ha, va=va)
        text.set_position((right * reach, up * reach))
        taken.append(_box(x, y, size, best[2], reach * pixel))
        if reach > GAP:
            axis.annotate(
                "", (label.x, label.y), xytext=(right * reach, up * reach),
                textcoords="offset points", zorder=3,
                arrowprops={"arrowstyle": "-", "color": label.color, "lw": 0.6, "alpha": 0.6},
            )  # fmt: skip


def _around(x: float, y: float, radius: float) -> Box:
    return x - radius, y - radius, x + radius, y + radius


def _box(x: float, y: float, size: Any, way: tuple[str, str, float, float], reach: float) -> Box:
    ha, va, right, up = way
    width, height = size.width, size.height
    left = x + right * reach - {"left": 0.0, "center": width / 2, "right": width}[ha]
    bottom = y + up * reach - {"bottom": 0.0, "center": height / 2, "top": height}[va]
    return left, bottom, left + width, bottom + height


def _cost(box: Box, taken: list[Box], inside: Box) -> float:
    """Square pixels that would be covered, and far more for what would be cut off."""
    covered = sum(_overlap(box, other) for other in taken)
    area = (box[2] - box[0]) * (box[3] - box[1])
    return covered + 5.0 * (area - _overlap(box, inside))


def _overlap(a: Box, b: Box) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return width * height if width > 0 and height > 0 else 0.0
