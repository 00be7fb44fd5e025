"""The axes of the wire and of each engine side by side, drawn from the table of chapter 7.

Every frame is drawn as somebody sees it who looks forward: right is right, up is up, and forward
leads into the picture.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape
from typing import NamedTuple

PLACE = "pictures/axes.svg"
TABLE = "1.0/07-conventions.md"
DIRECTIONS: Mapping[str, tuple[int, int, int]] = {
    "right": (1, 0, 0),
    "left": (-1, 0, 0),
    "up": (0, 1, 0),
    "down": (0, -1, 0),
    "forward": (0, 0, 1),
    "backward": (0, 0, -1),
}
"""Each direction as so much to the right, up and forward."""

_ROWS = re.compile(r"^\| frame \| x \| y \| z \| handedness \|.*\n\|[-|]+\n((?:\|.*\n)+)", re.M)
_COLUMNS, _WIDTH, _HEIGHT = 3, 260, 234
_HEAD = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" font-family="system-ui, sans-serif" font-size="14" text-anchor="middle" role="img">
<title>Axes of the wire and of each engine, seen by somebody who looks forward</title>
<style>
.card { fill: #ffffff; stroke: #d0d7de } text { fill: #1f2328 } .x { --c: #cf222e } .y { --c: #1a7f37 } .z { --c: #0969da }
@media (prefers-color-scheme: dark) { .card { fill: #161b22; stroke: #3d444d } text { fill: #f0f6fc } .x { --c: #ff7b72 } .y { --c: #56d364 } .z { --c: #79c0ff } }
.axis line { stroke: var(--c); stroke-width: 3 } .axis path, .axis text { fill: var(--c) } .axis text, .name { font-weight: 600 }
</style>
"""  # noqa: E501 - as it is drawn


class Frame(NamedTuple):
    """One row of the table: where its axes lead, `right`, `down`, `forward` and so on."""

    name: str
    axes: tuple[str, str, str]
    handedness: str
    unit: str

    @property
    def is_right_handed(self) -> bool:
        """Whether x × y = z; to the right, up and forward are themselves left-handed."""
        (a, b, c), (d, e, f), (g, h, i) = (DIRECTIONS[axis] for axis in self.axes)
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0


def frames(chapter: str) -> list[Frame]:
    """The frames of the table in the chapter; ValueError where there is no such table."""
    (rows,) = _ROWS.findall(chapter)
    found = []
    for row in rows.splitlines():
        name, x, y, z, handedness, unit = row.strip("| ").split(" | ")
        found.append(Frame(name, (x, y, z.partition(";")[0]), handedness, unit))
    return found


def axes(chapter: str) -> str:
    """The picture."""
    found = frames(chapter)
    size = {"width": _COLUMNS * _WIDTH, "height": -(-len(found) // _COLUMNS) * _HEIGHT}
    head = re.sub(r"\{(width|height)\}", lambda match: str(size[match[1]]), _HEAD)
    return "".join([head, *(_drawn(place, each) for place, each in enumerate(found)), "</svg>\n"])


def _drawn(place: int, frame: Frame) -> str:
    left, top = place % _COLUMNS * _WIDTH, place // _COLUMNS * _HEIGHT
    caption = f"{frame.handedness}-handed, {frame.unit}"
    lines = [
        f'<g transform="translate({left} {top})">',
        f'<rect class="card" x="5" y="5" width="{_WIDTH - 10}" height="{_HEIGHT - 10}" rx="8"/>',
        f'<text class="name" x="{_WIDTH // 2}" y="28">{escape(frame.name)}</text>',
        f'<text x="{_WIDTH // 2}" y="{_HEIGHT - 16}">{caption}</text>',
        *(_arrow(name, axis) for name, axis in zip("xyz", frame.axes)),
        "</g>\n",
    ]
    return "\n".join(lines)


def _arrow(name: str, axis: str) -> str:
    """An axis with its name. Forward leads up and to the right, so that no two are in one line."""
    right, up, forward = DIRECTIONS[axis]
    dx, dy = 56 * right + 40 * forward, -50 * up - 36 * forward
    length = (dx * dx + dy * dy) ** 0.5
    ux, uy = dx / length, dy / length
    x, y = _WIDTH // 2 + dx, 120 + dy
    tip = f"M{x + 10 * ux:.0f} {y + 10 * uy:.0f}L{x - 5 * uy:.0f} {y + 5 * ux:.0f}"
    tip += f"L{x + 5 * uy:.0f} {y - 5 * ux:.0f}Z"
    text_x = x + 22 * (right + forward)
    text_y = y + 5 - 20 * up - 18 * forward + 20 * abs(right)
    return (
        f'<g class="axis {name}"><line x1="{_WIDTH // 2}" y1="120" x2="{x}" y2="{y}"/>'
        f'<path d="{tip}"/><text x="{text_x}" y="{text_y}">{name} {axis}</text></g>'
    )
