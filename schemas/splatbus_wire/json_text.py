"""Payloads as JSON objects, as strictly as JSN-1 to JSN-5 ask; what is wrong, and where.

The standard library's parser takes more than RFC 8259 allows: NaN, repeated names, 1e400 as
infinity, half a surrogate pair. Hooks refuse these as they are met. Only then is the text parsed
again, to find the JSON pointer: what is valid pays nothing for the error's address.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from splatbus_schemas import LIMITS

from splatbus_wire.errors import ProtocolError
from splatbus_wire.json_bounds import check_depth, check_values

MAX_VALUES: int = LIMITS["max_server_values"]
_MAX_POINTER_CHARS = 512
_WHITE_SPACE = re.compile(r"[ \t\n\r]*")
SURROGATES = re.compile(r"\\u[dD](?:[89abAB]..\\u[dD][c-fC-F]..|(?P<half>[89a-fA-F]..))")
"""Escapes of a pair, or of half of one, in a text without escaped backslashes."""


def parse_object(payload: bytes, most: int = MAX_VALUES) -> dict[str, Any]:
    """Return the JSON object that a payload holds, with plain Python values.

    Args:
        payload: of one packet.
        most: values in it.

    Raises:
        ProtocolError: `malformed_json`, with the offset of the fault or a pointer to it [JSN-1,
            JSN-2, JSN-3, JSN-5, JSN-12]; `not_an_object` [JSN-1]; `invalid_number`, with a
            pointer, for a number that is not finite in double precision [JSN-4].
    """
    check_values(payload, most)
    text = _decode(payload)
    check_depth(payload, most)
    value = _parse(text)
    if "\\ud" in text or "\\uD" in text:
        _check_pairs(text, value)
    if not isinstance(value, dict):
        raise ProtocolError(
            "not_an_object",
            f"the payload is {kind_of(value)}, not an object",
            requirement="JSN-1",
            pointer="",
        )
    return value


def serialize(message: Mapping[str, Any]) -> bytes:
    """Return a message as compact UTF-8, each float in the shortest form that reads back [ACC-1].

    Raises:
        ProtocolError: `invalid_number`, with a pointer, for NaN or an infinity [JSN-4];
            `malformed_json` for half a surrogate pair [JSN-1], nesting that is too deep [JSN-5], or
            too many values [JSN-12].
    """
    try:
        payload = _ENCODER.encode(message).encode()
    except UnicodeEncodeError:
        raise ProtocolError(
            "malformed_json",
            "a string to be sent holds half a surrogate pair, which UTF-8 cannot express",
            requirement="JSN-1",
        ) from None
    except ValueError:
        pointer, _ = _find(
            message, lambda item: isinstance(item, float) and not math.isfinite(item)
        )
        raise ProtocolError(
            "invalid_number",
            "a number to be sent is not finite",
            requirement="JSN-4",
            pointer=pointer,
        ) from None
    check_depth(payload, MAX_VALUES)
    # No value takes less than two bytes, with what parts it from others.
    if len(payload) > 2 * MAX_VALUES and (values := _count(message)) > MAX_VALUES:
        raise ProtocolError(
            "malformed_json",
            f"{values} values were to be sent; {MAX_VALUES} are allowed",
            requirement="JSN-12",
        )
    return payload


def kind_of(value: Any) -> str:
    """What a parsed JSON value is, in words for an error."""
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    kinds = {int: "a number", float: "a number", str: "a string", list: "an array"}
    return kinds.get(type(value), "an object")


def brief(value: Any) -> str:
    """A value for an error's text, cut short: what a peer sends must not fill what is sent back."""
    shown = json.dumps(value[:64] if isinstance(value, str) else value, ensure_ascii=False)
    return shown if len(shown) <= 80 else f"{shown[:77]}..."


def step(name: str | int) -> str:
    """One step of a JSON pointer, escaped (RFC 6901)."""
    return f"/{str(name).replace('~', '~0').replace('/', '~1')}"


def _count(value: Any) -> int:
    """How many values there are in a value, itself among them."""
    if isinstance(value, Mapping):
        value = tuple(value.values())
    return 1 + sum(map(_count, value)) if isinstance(value, (list, tuple)) else 1


def _decode(payload: bytes) -> str:
    try:
        text = payload.decode()
    except UnicodeDecodeError as error:
        raise ProtocolError(
            "malformed_json",
            f"the payload is not UTF-8: {error.reason}",
            requirement="JSN-1",
            offset=error.start,
        ) from None
    if text.startswith("\ufeff"):
        raise ProtocolError(
            "malformed_json",
            "the payload begins with a byte-order mark",
            requirement="JSN-2",
            offset=0,
        )
    return text


def _check_pairs(text: str, value: Any) -> None:
    """Refuse an escape of half a surrogate pair, which no UTF-8 text holds."""
    try:
        _ENCODER.encode(value).encode()
        return  # a hundred thousand escapes are looked at only where one of them is wrong
    except UnicodeEncodeError:
        pass
    for escape in SURROGATES.finditer(text.replace(r"\\", "  ")):
        if escape["half"]:
            raise ProtocolError(
                "malformed_json",
                f"\\ud{escape['half']} is half a surrogate pair, which no UTF-8 text holds",
                requirement="JSN-1",
                offset=len(text[: escape.start()].encode()),
            )


def _parse(text: str) -> Any:
    start = _skip_white_space(text, 0)
    try:
        try:
            value, end = STRICT.raw_decode(text, start)
        except ProtocolError:
            tree, _ = _TOLERANT.raw_decode(text, start)
            raise _first_flaw(tree) from None
    except json.JSONDecodeError as error:
        _refuse_text(error.msg, text, error.pos)
    end = _skip_white_space(text, end)
    if end != len(text):
        _refuse_text("text after the end of the value", text, end)
    return value


def _skip_white_space(text: str, start: int) -> int:
    space = _WHITE_SPACE.match(text, start)
    assert space is not None
    return space.end()


def _refuse_text(problem: str, text: str, position: int) -> NoReturn:
    raise ProtocolError(
        "malformed_json",
        f"the payload is not JSON: {problem[:1].lower()}{problem[1:].removesuffix(' at')}",
        requirement="JSN-1",
        offset=len(text[:position].encode()),
    )


def read_members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; refuses a name that stands there twice [JSN-3]."""
    members = dict(pairs)
    if len(members) != len(pairs):
        seen: set[str] = set()
        for name, _ in pairs:
            if name in seen:
                break
            seen.add(name)
        raise ProtocolError(
            "malformed_json",
            f"the name {brief(name)} stands twice in one object",
            requirement="JSN-3",
            pointer=step(name),
        )
    return members


def read_float(text: str) -> float:
    """A number with a fraction or an exponent; refuses what is not finite [JSN-4]."""
    value = float(text)
    if not math.isfinite(value):
        _refuse_number(text)
    return value


def read_integer(text: str) -> int:
    """A number without either; refuses what is not finite."""
    # float() first: int() takes quadratic time, and refuses long texts with an error of its own.
    read_float(text)
    return int(text)


def read_constant(text: str) -> NoReturn:
    """Refuses NaN and infinities, which the parser would take [JSN-4]."""
    _refuse_number(text)


def _refuse_number(text: str) -> NoReturn:
    shown = text if len(text) <= 40 else f"{text[:37]}... ({len(text)} characters)"
    raise ProtocolError(
        "invalid_number",
        f"{shown} is not a finite number in double precision",
        requirement="JSN-4",
        pointer="",
    )


Hook = Callable[[Any], Any]


def _leaving_flaws(hook: Hook) -> Hook:
    """The hook, but with its error as the value instead of a way out."""

    def parse(text: Any) -> Any:
        try:
            return hook(text)
        except ProtocolError as flaw:
            return flaw

    return parse


def decoder(wrap: Callable[[Hook], Hook]) -> json.JSONDecoder:
    """A parser with these hooks, each wrapped."""
    return json.JSONDecoder(
        object_pairs_hook=wrap(read_members),
        parse_float=wrap(read_float),
        parse_int=wrap(read_integer),
        parse_constant=wrap(read_constant),
    )


STRICT = decoder(lambda hook: hook)
_TOLERANT = decoder(_leaving_flaws)
_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def _first_flaw(tree: Any) -> ProtocolError:
    """The first error that a tolerant parse left, with its pointer made to begin at the root."""
    pointer, flaw = _find(tree, lambda value: isinstance(value, ProtocolError))
    assert isinstance(flaw, ProtocolError)
    located = f"{pointer}{flaw.pointer}"
    flaw.pointer = located if len(located) <= _MAX_POINTER_CHARS else pointer
    return flaw


def _find(tree: Any, wanted: Callable[[Any], bool]) -> tuple[str, Any]:
    """The first value in document order that is wanted, and the JSON pointer to it."""
    # A path is a chain of (path of the parent, name): pointers written out for every value would
    # take more memory than the payload by orders of magnitude.
    pending: list[tuple[Any, Any]] = [(None, tree)]
    while pending:
        path, value = pending.pop()
        if wanted(value):
            return _pointer(path), value
        if isinstance(value, Mapping):
            pending += [((path, name), item) for name, item in value.items()][::-1]
        elif isinstance(value, (list, tuple)):
            pending += [((path, index), item) for index, item in enumerate(value)][::-1]
    raise LookupError("nothing in the tree is wanted")


def _pointer(path: Any) -> str:
    names: list[str | int] = []
    while path is not None:
        path, name = path
        names.append(name)
    pointer = ""
    for name in reversed(names):
        if len(pointer) + len(step(name)) > _MAX_POINTER_CHARS:
            break  # the value around it is where to look
        pointer += step(name)
    return pointer
