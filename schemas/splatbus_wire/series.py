"""What a renderer has read of itself, as the series of a `telemetry` message (1.1 annex A)."""

from __future__ import annotations

import math
from typing import Any, SupportsFloat, Union

import numpy as np
from numpy.typing import ArrayLike
from splatbus_schemas import LIMITS

from splatbus_wire.messages import Histogram, Scalar, Series, Text

Reading = Union[SupportsFloat, tuple[SupportsFloat, str], str, tuple[ArrayLike, ArrayLike]]
"""A number, a number and its unit, a text, or counts and edges as `numpy.histogram` returns them.
"""


def series(name: str, value: Any) -> Series:
    """A reading as it is sent.

    Raises:
        ValueError: its name, or the value, is none that can be [TEL-2].
    """
    try:
        return _series(_text(name, 1, LIMITS["max_name_chars"]), value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"telemetry {name!r}: {error} [TEL-2]") from None


def _series(name: str, value: Any) -> Series:
    if isinstance(value, str):
        return Text(name, _text(value, 0, LIMITS["max_text_chars"]))
    if isinstance(value, (tuple, list)) and len(value) == 2:
        first, second = value
        if isinstance(second, str):
            return Scalar(name, _number(first), _text(second, 0, LIMITS["max_name_chars"]))
        return _histogram(name, np.asarray(first), np.asarray(second, np.float64))
    return Scalar(name, _number(value))


def _text(text: str, least: int, most: int) -> str:
    if not least <= len(text) <= most:
        raise ValueError(f"{len(text)} characters are not {least} to {most}")
    text.encode()  # a surrogate by itself is no text
    return text


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{number} is not finite")
    return number


def _histogram(name: str, counts: Any, edges: Any) -> Histogram:
    most = LIMITS["max_edges"]
    if edges.ndim != 1 or counts.shape != (len(edges) - 1,) or not 2 <= len(edges) <= most:
        shapes = f"counts of shape {counts.shape} and edges of shape {edges.shape}"
        raise ValueError(f"{shapes} are not n and n + 1, of at most {most}")
    if not (np.isfinite(edges).all() and (edges[1:] > edges[:-1]).all()):
        raise ValueError("the edges do not ascend, or are not finite")
    if not ((counts >= 0) & (counts <= LIMITS["max_safe_integer"]) & (counts % 1 == 0)).all():
        raise ValueError("the counts are not all whole numbers from 0 on")
    return Histogram(name, tuple(edges.tolist()), tuple(map(int, counts.tolist())))
