"""How numbers and documents are written in the vector files."""

import json
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from splatbus_conformance.oracle.rounding import to_double, to_single

WIDTH = 116

Json = Any
Number = float | Fraction


def both(value: Number | Sequence[Any]) -> Json:
    """Return a number, or nested rows of numbers, as decimals and as hexadecimal floats."""
    return {"decimal": _each(value, _decimal), "hex": _each(value, _hexadecimal)}


def pose(position: Sequence[Number], rotation: Sequence[Number]) -> Json:
    """Return a position (x, y, z) and a rotation (x, y, z, w)."""
    return {"position": both(position), "rotation": both(rotation)}


def exactly(note: str, requirement: str | None = None) -> Json:
    """Return the tolerance of a quantity of which only one value is right."""
    return {"measure": "exact", **_clause(requirement), "note": note}


def within(measure: str, bound: Number, requirement: str | None, note: str, **more: Json) -> Json:
    """Return the tolerance of a quantity that may be off by `bound`; None: no clause says so."""
    return {
        "measure": measure,
        "bound": both(bound),
        **_clause(requirement),
        "note": note,
        **more,
    }


def _clause(requirement: str | None) -> Json:
    return {} if requirement is None else {"requirement": requirement}


def single(value: float) -> float:
    """Return the single-precision number nearest to a decimal, as a float."""
    return to_single(Fraction(value)) if math.isfinite(value) and value else value


def text(value: Json) -> str:
    """Return a document as JSON, with whatever fits on a line on one line."""
    return _text(value, 0) + "\n"


def _each(value: Any, form: Any) -> Json:
    if isinstance(value, Sequence):
        return [_each(entry, form) for entry in value]
    return form(to_double(value) if isinstance(value, Fraction) else float(value))


def _decimal(value: float) -> Json:
    return value if math.isfinite(value) else _hexadecimal(value)


def _hexadecimal(value: float) -> str:
    if not math.isfinite(value):
        return str(value)
    mantissa, exponent = value.hex().split("p")
    whole, fraction = mantissa.split(".")
    return f"{whole}.{fraction.rstrip('0') or '0'}p{exponent}"


def _text(value: Json, indent: int) -> str:
    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if not isinstance(value, dict | list) or not value or indent + len(line) <= WIDTH:
        return line
    inner = " " * (indent + 1)
    if isinstance(value, list):
        entries = [_text(entry, indent + 1) for entry in value]
        opening, closing = "[]"
    else:
        entries = [f"{json.dumps(key)}: {_text(entry, indent + 1)}" for key, entry in value.items()]
        opening, closing = "{}"
    body = ",\n".join(inner + entry for entry in entries)
    return f"{opening}\n{body}\n{' ' * indent}{closing}"
