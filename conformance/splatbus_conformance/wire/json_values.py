"""Questions about JSON values, as the rules ask them, and readers of values to reckon with.

A number that is not finite passes every question: JSN-4 alone says what is wrong with it. No reader
gives one: `within`, `whole`, `finite`, `finites` and `texts` take whatever a testee may have sent.
"""

import json
import math
import re
import struct
from itertools import pairwise
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.json_reading import shorten

SAFE: int = LIMITS["max_safe_integer"]
MAX_CHARS: int = LIMITS["max_name_chars"]
_VERSION = re.compile(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)")
_HANDLE = re.compile(r"[A-Za-z0-9+/]{86}==")


def is_number(value: object) -> bool:
    """A JSON number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def unspeakable(value: object) -> bool:
    """A number that is not finite."""
    return isinstance(value, float) and not math.isfinite(value)


def number_in(value: Any, low: float, high: float = math.inf) -> bool:
    """A number from `low` to `high`, both included."""
    return is_number(value) and (unspeakable(value) or low <= value <= high)


def positive(value: Any) -> bool:
    """A number greater than 0."""
    return is_number(value) and (unspeakable(value) or value > 0)


def integer_in(value: Any, low: int, high: int = SAFE) -> bool:
    """An integer from `low` to `high`, with or without a fraction of zero (JSN-6)."""
    return number_in(value, low, high) and (unspeakable(value) or value == int(value))


def whole(value: Any, low: int = -SAFE, high: int = SAFE) -> int | None:
    """The integer that a value is, for reckoning with; None if it is none within the range."""
    return int(value) if integer_in(value, low, high) and not unspeakable(value) else None


def as_cut(value: object, *meant: int | None) -> str:
    """As the end of a sentence, how one of these integers became another: by the bits that a
    program has for it, or by single precision. Nothing if it did not.
    """
    for number in meant if (found := whole(value)) is not None else ():
        if number is None or number == found:
            continue
        for bits in (32, 16):
            low = number % (1 << bits)
            if found in (low, low - (1 << bits)):
                return f": {number} was cut to {bits} bits"
        if found == int(struct.unpack("<f", struct.pack("<f", number))[0]):
            return f": {number} was rounded to single precision"
    return ""


def within(value: object, *path: str | int) -> Any:
    """What a value holds at the end of a path of names and places; None where nothing is."""
    for step in path:
        if isinstance(value, dict):
            value = value.get(step)
        elif isinstance(value, list) and isinstance(step, int) and -len(value) <= step < len(value):
            value = value[step]
        else:
            return None
    return value


def finite(value: object) -> float | None:
    """A number to reckon with; None for what is none, or not finite."""
    number = as_double(value) if is_number(value) else math.inf
    return number if math.isfinite(number) else None


def finites(value: object, count: int) -> tuple[float, ...] | None:
    """An array of so many numbers to reckon with."""
    items = [finite(item) for item in value] if isinstance(value, list) else []
    found = tuple(item for item in items if item is not None)
    return found if len(found) == len(items) == count else None


def array(value: object) -> list[Any]:
    """The items of an array; none of what is no array."""
    return value if isinstance(value, list) else []


def texts(value: object) -> list[str]:
    """The strings in an array; none in what is no array."""
    return [item for item in array(value) if isinstance(item, str)]


def text_of(value: object, low: int, high: int) -> bool:
    """A string of `low` to `high` characters."""
    return isinstance(value, str) and low <= len(value) <= high


def is_version(value: object) -> bool:
    """Two decimal integers without sign or leading zeros, joined by a dot; up to 64 characters."""
    return (
        isinstance(value, str) and len(value) <= MAX_CHARS and _VERSION.fullmatch(value) is not None
    )


def is_handle(value: object) -> bool:
    """64 bytes in base64 with the standard alphabet and padding (INI-7)."""
    return isinstance(value, str) and _HANDLE.fullmatch(value) is not None


def numbers(value: object, count: int) -> bool:
    """An array of so many numbers."""
    return isinstance(value, list) and len(value) == count and all(map(is_number, value))


def ascending(value: Any, least: int, most: int = 0, *, strictly: bool = False) -> bool:
    """An array of `least` to `most` numbers, so many if `most` is not given, none less than the
    one before it, nor equal to it if `strictly`.
    """
    if not isinstance(value, list) or not least <= len(value) <= (most or least):
        return False
    if not all(map(is_number, value)):
        return False
    pairs = [pair for pair in pairwise(value) if not any(map(unspeakable, pair))]
    return all(a < b or (a == b and not strictly) for a, b in pairs)


def as_double(value: Any) -> float:
    """A JSON number in double precision; infinite where that ends."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def strings(value: object) -> list[str] | None:
    """An array of strings, or None."""
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        return value
    return None


def show(value: object) -> str:
    """A value as JSON, cut when it is long."""
    return shorten(json.dumps(value))
