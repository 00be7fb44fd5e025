"""Read JSON as the judge does: take as much as can be taken, and list every rule that it breaks.

A receiver refuses (spec 1.0 section 2.2); a judge wants to say everything that is wrong.
"""

import json
import math
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS


class Fault(NamedTuple):
    """One way in which a payload breaks a requirement."""

    requirement: str
    text: str


class Reading(NamedTuple):
    """What a payload holds."""

    value: dict[str, Any] | None
    """The object, or None if the payload is none."""
    faults: tuple[Fault, ...]


def read(payload: bytes) -> Reading:
    """Read one payload; never raises."""
    faults: list[Fault] = []
    if payload.startswith(b"\xef\xbb\xbf"):
        faults.append(Fault("JSN-2", "the payload begins with a byte-order mark"))
        payload = payload[3:]
    try:
        text = payload.decode("utf-8")
    except UnicodeDecodeError as error:
        fault = Fault("JSN-1", f"byte {error.start} of the payload is not UTF-8")
        return Reading(None, (*faults, fault))
    if (depth := nesting(text)) > LIMITS["max_json_depth"]:
        return Reading(None, (*faults, Fault("JSN-5", f"nested {depth} deep")))

    def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        names = [name for name, _ in pairs]
        for name in sorted({name for name in names if names.count(name) > 1}):
            faults.append(Fault("JSN-3", f"the member {name!r} stands more than once"))
        return dict(pairs)

    def constant(spelling: str) -> float:
        faults.append(Fault("JSN-4", f"{spelling} is no JSON number"))
        return math.nan

    def number(spelling: str) -> float:
        value = float(spelling)
        if not math.isfinite(value):
            faults.append(Fault("JSN-4", f"{shorten(spelling)} overflows double precision"))
        return value

    def integer(spelling: str) -> int | float:
        return number(spelling) if len(spelling) > 300 else int(spelling)

    try:
        value = json.loads(
            text,
            object_pairs_hook=members,
            parse_constant=constant,
            parse_float=number,
            parse_int=integer,
        )
    except ValueError as error:
        return Reading(None, (*faults, Fault("JSN-1", f"no JSON: {error}")))
    if not isinstance(value, dict):
        kind = type(value).__name__
        return Reading(None, (*faults, Fault("JSN-1", f"the payload is a {kind}, no object")))
    return Reading(value, tuple(faults))


def nesting(text: str) -> int:
    """The greatest depth of arrays and objects in a JSON text (1 for a flat object)."""
    deepest = depth = 0
    in_string = escaped = False
    for character in text:
        if in_string:
            if escaped:
                escaped = False
            elif character == "\\":
                escaped = True
            elif character == '"':
                in_string = False
        elif character == '"':
            in_string = True
        elif character in "{[":
            depth += 1
            deepest = max(deepest, depth)
        elif character in "}]":
            depth -= 1
    return deepest


def shorten(text: str, limit: int = 60) -> str:
    """`text`, cut in the middle when it is longer than `limit` characters."""
    if len(text) <= limit:
        return text
    return f"{text[: limit // 2]}…{text[-(limit // 2) :]} ({len(text)} characters)"
