"""Read JSON as the judge does: take as much as can be taken, and list every rule that it breaks.

A receiver refuses (spec 1.0 section 2.2); a judge wants to say everything that is wrong.
"""

import contextlib
import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from itertools import accumulate
from sys import intern
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.message_kinds import NUMBER, Shape

LONG_NUMBER = 300
"""Digits from which an integer may overflow double precision."""
_NO_BRACKET = re.compile(r'"(?:[^"\\]|\\.?)*(?:"|\Z)|[^][{}"]+', re.DOTALL)
"""Strings, the last of which may not end, and what is between them and brackets."""
_STRING = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
_DECIMAL_COMMA = re.compile(r":\s*(-?[0-9]+,[0-9]+(?:[eE][-+]?[0-9]+)?)")
"""As programs write numbers that follow the language of their user."""
_STEPS = {"{": 1, "[": 1, "}": -1, "]": -1}
_HALF_A_PAIR = re.compile("[\ud800-\udfff]")
_JSON_NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")


class PayloadFault(NamedTuple):
    """One way in which a payload breaks a requirement."""

    requirement: str
    code: str
    text: str
    pointer: str = ""
    """JSON Pointer to the fault, where it has a place in the message."""


class ReadPayload(NamedTuple):
    """What a payload holds."""

    value: dict[str, Any] | None
    """The object, or None if the payload is none."""
    faults: tuple[PayloadFault, ...]


def read(payload: bytes) -> ReadPayload:
    """Read one payload; never raises."""
    # Most payloads break nothing, and one decoder reads them all.
    with contextlib.suppress(_Doubt, ValueError, RecursionError):
        text = payload.decode("utf-8")
        shallow = text.count("{") + text.count("[") <= LIMITS["max_json_depth"]
        if shallow and "\\u" not in text:
            value = _FAULTLESS.decode(text)
            if isinstance(value, dict):
                return ReadPayload(value, ())
    return _read_closely(payload)


class _Doubt(Exception):  # noqa: N818 - no error yet
    """Something may break a requirement."""


def _different_members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    # A recording has the same few names in a hundred thousand messages: each is kept once.
    members = {intern(name): value for name, value in pairs}
    if len(members) < len(pairs):
        raise _Doubt
    return members


def _finite(spelling: str) -> float:
    value = float(spelling)
    if math.isinf(value):
        raise _Doubt
    return value


def _short(spelling: str) -> int:
    if len(spelling) > LONG_NUMBER:
        raise _Doubt
    return int(spelling)


def _no_constant(spelling: str) -> float:
    raise _Doubt


_FAULTLESS = json.JSONDecoder(
    object_pairs_hook=_different_members,
    parse_float=_finite,
    parse_int=_short,
    parse_constant=_no_constant,
)


def _read_closely(payload: bytes) -> ReadPayload:
    """Read one payload as `read` does, and find every fault."""
    faults: list[PayloadFault] = []
    if payload.startswith(b"\xef\xbb\xbf"):
        faults.append(
            PayloadFault("JSN-2", "byte-order-mark", "the payload begins with a byte-order mark")
        )
        payload = payload[3:]
    try:
        text = payload.decode("utf-8")
    except UnicodeDecodeError as error:
        fault = PayloadFault(
            "JSN-1", "not-utf-8", f"byte {error.start} of the payload is not UTF-8"
        )
        return ReadPayload(None, (*faults, fault))
    deepest: int = LIMITS["max_json_depth"]
    # Counting brackets is cheap, and nearly every text has too few of them to be nested too deep.
    if text.count("{") + text.count("[") > deepest and (depth := nesting(text)) > deepest:
        return ReadPayload(
            None, (*faults, PayloadFault("JSN-5", "too-deep", f"nested {depth} deep"))
        )

    def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        for name, times in Counter(name for name, _ in pairs).items():
            if times > 1:
                faults.append(
                    PayloadFault(
                        "JSN-3",
                        "member-twice",
                        f"the member {shorten(repr(name))} stands {times} times",
                    )
                )
        return dict(pairs)

    def constant(spelling: str) -> float:
        faults.append(PayloadFault("JSN-4", "not-finite", f"{spelling} is no JSON number"))
        return math.nan

    def number(spelling: str) -> int | float:
        value = spelled(spelling)
        if not math.isfinite(value):
            faults.append(
                PayloadFault(
                    "JSN-4", "overflows", f"{shorten(spelling)} overflows double precision"
                )
            )
        return value

    try:
        value = json.loads(
            text,
            object_pairs_hook=members,
            parse_constant=constant,
            parse_float=number,
            parse_int=number,
        )
    except ValueError as error:
        comma = _DECIMAL_COMMA.search(_STRING.sub('""', text))
        why = f"{comma[1]} is no number: a point is wanted for the comma" if comma else str(error)
        return ReadPayload(None, (*faults, PayloadFault("JSN-1", "no-json", f"no JSON: {why}")))
    if "\\u" in text and any(_HALF_A_PAIR.search(each) for each in _strings(value)):
        faults.append(
            PayloadFault(
                "JSN-1",
                "half-a-surrogate-pair",
                "a string holds an escape of half a pair of surrogates",
            )
        )
    if not isinstance(value, dict):
        kind = type(value).__name__
        return ReadPayload(
            None,
            (*faults, PayloadFault("JSN-1", "no-object", f"the payload is a {kind}, no object")),
        )
    return ReadPayload(value, tuple(faults))


def too_many(payload: bytes, value: dict[str, Any], most: int) -> tuple[PayloadFault, ...]:
    """Counted only where so many bytes can hold more values than there may be."""
    if len(payload) <= 2 * most or (count := values(value)) <= most:
        return ()
    text = f"{count:,} values, {most:,} are allowed"
    return (PayloadFault("JSN-12", "too-many-values", text),)


def values(value: Any) -> int:
    """How many values a JSON value is, itself and all inside of it (JSN-12)."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + sum(map(values, inner))


def _strings(value: Any) -> Iterator[str]:
    """Every string and name in a JSON value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from value
        yield from _strings(list(value.values()))
    elif isinstance(value, list):
        for each in value:
            yield from _strings(each)


def take_numbers(value: dict[str, Any], shape: Shape) -> ReadPayload:
    """The message with numbers for the strings that spell them where `shape` has numbers.

    One fault for all of them (JSN-4), so that other rules can judge the numbers that are meant.
    """
    found: list[tuple[str, str]] = []

    def take(part: Any, shape: Shape, pointer: str) -> Any:
        if shape == NUMBER:
            if isinstance(part, str) and _JSON_NUMBER.fullmatch(part):
                found.append((pointer, part))
                return spelled(part)
        elif isinstance(shape, dict) and isinstance(part, dict):
            return {
                name: take(member, shape[name], f"{pointer}/{name}") if name in shape else member
                for name, member in part.items()
            }
        elif isinstance(shape, list) and isinstance(part, list):
            return [take(item, shape[0], f"{pointer}/{i}") for i, item in enumerate(part)]
        return part

    taken = take(value, shape, "")
    if not found:
        return ReadPayload(value, ())
    pointer, spelling = found[0]
    finite = all(math.isfinite(spelled(it)) for _, it in found)
    code = "number-as-string" if finite else "overflows"
    text = f'numbers written as strings: {len(found)}, the first "{shorten(spelling)}"'
    return ReadPayload(taken, (PayloadFault("JSN-4", code, text, pointer),))


def spelled(spelling: str) -> int | float:
    """The value of a JSON number; infinite where it overflows double precision."""
    if len(spelling) <= LONG_NUMBER and spelling.lstrip("-").isdecimal():
        return int(spelling)
    return float(spelling)


def nesting(text: str) -> int:
    """The greatest depth of arrays and objects in a JSON text (1 for a flat object)."""
    steps = map(_STEPS.__getitem__, _NO_BRACKET.sub("", text))
    return max(accumulate(steps, initial=0))


def shorten(text: str, limit: int = 60) -> str:
    """`text`, cut in the middle when it is longer than `limit` characters."""
    if len(text) <= limit:
        return text
    return f"{text[: limit // 2]}…{text[-(limit // 2) :]} ({len(text)} characters)"
