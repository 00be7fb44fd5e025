"""Figures from a renderer, printed as they come: a table on a terminal, lines or JSON elsewhere."""

from __future__ import annotations

import json
import math
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import TextIO

from splatbus_client.loop import clock
from splatbus_client.session import Session
from splatbus_schemas import LIMITS
from splatbus_schemas.visible import visible
from splatbus_wire.messages import Histogram, Scalar, Series, Telemetry, message_object

from splatbus_viewer.terminal import Lines, columns

_PATIENCE_SECONDS = 0.25
_CURVE_LETTERS = 32

Show = Callable[[Telemetry], None]


def watch(
    session: Session,
    names: Iterable[str] | None,
    *,
    seconds: float,
    stopped: threading.Event,
    show: Show,
) -> None:
    """Show what a server tells of itself until `stopped` is set or `seconds` have passed.

    Args:
        session: with any server, or none yet.
        names: of the series to subscribe to; None for all.
        seconds: how long to run; may be infinite.
        stopped: set by somebody else to end it.
        show: called with each message.

    Raises:
        NotOfferedError: the server does not offer telemetry.
        ProtocolError: there are too many names, or one is too long [TEL-1].
    """
    session.subscribe_telemetry(names)
    end = clock() + seconds
    while not stopped.is_set() and (now := clock()) < end:
        try:
            show(session.next_telemetry(min(_PATIENCE_SECONDS, end - now)))
        except TimeoutError:
            continue


def as_json(out: TextIO) -> Show:
    """Show each message as one line of JSON, with the members that it had on the wire.

    In ASCII, and with nothing in it that a CI system obeys: see `visible`, which is no JSON.
    """

    def show(telemetry: Telemetry) -> None:
        out.write(json.dumps(message_object(telemetry)).replace("##", r"#\u0023") + "\n")
        out.flush()

    return show


def as_text(out: TextIO) -> Show:
    """Show a table that is written over on a terminal; else one line for each series."""
    return _table(out) if out.isatty() else _lines(out)


def _table(out: TextIO) -> Show:
    """The newest of each series, with the course of those that are numbers."""
    newest: dict[str, Series] = {}
    courses: dict[str, deque[float]] = {}
    lines = Lines(out)

    def show(telemetry: Telemetry) -> None:
        for series in telemetry.series:
            newest[series.name] = series
            if isinstance(series, Scalar):
                course = courses.setdefault(series.name, deque(maxlen=_CURVE_LETTERS))
                course.append(series.value)
        for name in list(newest)[: -LIMITS["max_series"]]:  # of a server that ever has new ones
            del newest[name]
            courses.pop(name, None)
        rows = [_cells(series, courses.get(series.name, ())) for series in newest.values()]
        left, right = (max((len(row[i]) for row in rows), default=0) for i in (0, 1))
        head = f"telemetry {telemetry.seq}, {telemetry.time:.3f} s on the server's clock"
        lines.write([head, *(f"  {row[0]:<{left}}  {row[1]:>{right}}  {row[2]}" for row in rows)])

    return show


def _lines(out: TextIO) -> Show:
    def show(telemetry: Telemetry) -> None:
        for series in telemetry.series:
            cells = " ".join(cell for cell in _cells(series) if cell)
            out.write(f"{telemetry.time:.3f} {cells}\n")
        out.flush()

    return show


def _cells(series: Series, course: Iterable[float] = ()) -> tuple[str, str, str]:
    """What a row shows: a name, a value, and a picture or a text."""
    name = visible(series.name)
    if isinstance(series, Scalar):
        unit = visible(series.unit or "")
        return name, f"{series.value:.6g} {unit}".rstrip(), _curve(list(course))
    if isinstance(series, Histogram):
        counts, edges = _fewer(series.counts), series.edges
        shape = columns(counts, 0, max(counts))
        return name, f"{sum(series.counts)} counted", f"{edges[0]:.4g} |{shape}| {edges[-1]:.4g}"
    return name, "", visible(series.value)


def _curve(course: list[float]) -> str:
    if len(course) < 2:
        return ""
    least, most = min(course), max(course)
    if least == most:
        return f"{columns(course, least - 1, most + 1)} {least:.4g}"
    bottom = max(least - (most / 8 - least / 8), -sys.float_info.max)
    return f"{columns(course, bottom, most)} {least:.4g} to {most:.4g}"


def _fewer(counts: tuple[int, ...]) -> list[int]:
    """The counts of so few bins that each can have a letter: neighbours are added up."""
    group = math.ceil(len(counts) / _CURVE_LETTERS)
    return [sum(counts[i : i + group]) for i in range(0, len(counts), group)]
