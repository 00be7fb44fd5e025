"""How much a payload holds, and how deep, before any of it is parsed [JSN-5, JSN-12].

A parser makes an object of each value, which takes a thousand times as long as to count it. So the
structure is looked at first: the payload without what stands in its strings. Every step here is one
of those that Python does at a gigabyte a second, and their number is bounded.
"""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import accumulate
from typing import Final

from splatbus_schemas import LIMITS

from splatbus_wire.errors import ProtocolError

MAX_DEPTH: Final[int] = LIMITS["max_json_depth"]
_EMPTY = re.compile(rb"\[[ \t\n\r]*\]|\{[ \t\n\r]*\}")
_BRACKET = re.compile(rb"[][{}]")
_DEEPER = dict.fromkeys(b"[{", 1) | dict.fromkeys(b"]}", 0xFF)
_DEPTH_STEPS = bytes(_DEEPER.get(byte, 0) for byte in range(256))
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


def check_values(payload: bytes, most: int) -> None:
    """Refuse what holds more values than that, in time linear in the payload [JSN-12].

    Raises:
        ProtocolError: `malformed_json`. Of what is no JSON, the parser says so, or this does.
    """
    if payload.count(b",") + payload.count(b"[") + payload.count(b"{") < most:
        return  # every value but the first follows one of these
    structure = _structure(payload, most)
    parted, begun = structure.count(b","), structure.count(b"[") + structure.count(b"{")
    if max(parted, begun) <= most:
        # Each value but the outermost follows a comma, or is the first of what holds it.
        values = 1 + parted + begun - len(_EMPTY.findall(structure))
        if values <= most:
            return
    raise ProtocolError(
        "malformed_json",
        f"the payload holds more than {most} values",
        requirement="JSN-12",
        pointer="",
    )


def check_depth(payload: bytes, most: int) -> None:
    """Refuse deep nesting before anything recurses into it, in time linear in the payload.

    Args:
        payload: with at most so many values.
        most: of values.

    Raises:
        ProtocolError: `malformed_json`, with the offset of the bracket [JSN-5]. Where the text is
            no JSON this is right up to the fault, and no parser goes beyond it.
    """
    if payload.count(b"[") + payload.count(b"{") <= MAX_DEPTH:
        return
    structure = _structure(payload, most)
    brackets = structure.translate(None, _NO_BRACKETS)
    # Where so many are closed, one was that had not been opened.
    brackets = brackets[: 2 * (brackets.count(b"[") + brackets.count(b"{"))]
    steps = memoryview(brackets.translate(_DEPTH_STEPS)).cast("b")
    for index, depth in enumerate(accumulate(steps)):
        if depth > MAX_DEPTH:
            found = _BRACKET.finditer(structure)
            raise ProtocolError(
                "malformed_json",
                f"arrays and objects are nested more than {MAX_DEPTH} deep",
                requirement="JSN-5",
                offset=next(match.start() for n, match in enumerate(found) if n == index),
            )


@lru_cache(maxsize=1)
def _structure(payload: bytes, most: int) -> bytes:
    """As long as the payload, with spaces in its strings; kept for the second check of it."""
    marks = payload.replace(rb"\\", b"  ").replace(rb"\"", b"  ")
    # A value has two of these, and its name two more: what has further ones is no such JSON.
    pieces = marks.split(b'"', 4 * most)
    pieces[1::2] = [b" " * len(string) for string in pieces[1::2]]
    return b'"'.join(pieces)
