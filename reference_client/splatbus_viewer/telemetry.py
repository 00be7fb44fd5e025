"""Figures from a renderer, printed as they come: a line for each series, or JSON."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Iterable
from typing import TextIO

from splatbus_client.loop import clock
from splatbus_client.session import Session
from splatbus_schemas.visible import visible
from splatbus_wire.messages import Histogram, Scalar, Series, Telemetry, message_object

_PATIENCE_SECONDS = 0.25
_BAR_LETTERS = 32
_EIGHTHS = " ▁▂▃▄▅▆▇█"

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
    """Show one line for each series: the server's time, a name, and what it is."""

    def show(telemetry: Telemetry) -> None:
        out.writelines(f"{telemetry.time:.3f} {_told(series)}\n" for series in telemetry.series)
        out.flush()

    return show


def _told(series: Series) -> str:
    name = visible(series.name)
    if isinstance(series, Scalar):
        return f"{name} {series.value:.6g} {visible(series.unit or '')}".rstrip()
    if isinstance(series, Histogram):
        edges = series.edges
        bars = _bars(series.counts)
        return f"{name} {sum(series.counts)} counted {edges[0]:.4g} |{bars}| {edges[-1]:.4g}"
    return f"{name} {visible(series.value)}"


def _bars(counts: tuple[int, ...]) -> str:
    """A letter for each bin, or for neighbours that are added up; full at the largest."""
    group = math.ceil(len(counts) / _BAR_LETTERS)
    numbers = [sum(counts[i : i + group]) for i in range(0, len(counts), group)]
    most = max(numbers) or 1
    return "".join(_EIGHTHS[max(round(n / most * 8), n > 0)] for n in numbers)
