"""What one message shows by itself: its schema says what is wrong, where, and by which sentence."""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from typing import Any

from splatbus_schemas import VERSIONS, names, schema
from splatbus_schemas.validation import violations

from splatbus_conformance.rules import Breach, Judgement
from splatbus_conformance.wire.json_values import show, unspeakable

Json = dict[str, Any]
CODES = {
    "required": "missing-member",
    **dict.fromkeys(("const", "enum", "contains", "anyOf"), "wrong-value"),
    "number": "not-a-number",
    "integer": "not-an-integer",
    **dict.fromkeys(("minimum", "maximum", "exclusiveMinimum", "multipleOf"), "out-of-range"),
    **dict.fromkeys(("string", "minLength", "maxLength", "pattern"), "bad-string"),
    **dict.fromkeys(("array", "minItems", "maxItems"), "not-an-array"),
    "object": "not-an-object",
    "uniqueItems": "not-unique",
    "not": "stray-member",
}
"""The code of a breach, by what of the schema is broken."""
OF_NUMBERS = ("not-a-number", "not-an-integer", "out-of-range")
"""Of a number that is not finite JSN-4 says what is wrong with it."""


def form(value: Json, kind: str, *requirements: str, version: str = "1.1") -> Iterator[Judgement]:
    """What a message shows of these requirements by the schema of its kind."""
    yield from map(Judgement, requirements)
    if _is_sound(value, kind, version):
        return
    for pointer, named, problem, keyword, found in violations(value, kind, version):
        code = CODES[keyword]
        spoken = not unspeakable(found) or not (code in OF_NUMBERS or keyword == "anyOf")
        for name in requirements if spoken else ():
            if name in named:
                yield Judgement(name, Breach(code, problem), pointer)


def greeting(value: Json) -> Iterator[Judgement]:
    """What a `hello` shows of NEG-2."""
    return form(value, "hello", "NEG-2")


def _is_sound(value: Json, kind: str, version: str) -> bool:
    """Whether nothing of a schema is broken, told in a hundredth of the time that what is takes."""
    try:
        return bool(_validator(kind, version).is_valid(value))
    except ValueError:  # numbers that are not finite
        return False


@cache
def _validator(kind: str, version: str) -> Any:
    from jsonschema_rs import Draft202012Validator, Registry

    loaded = [schema(name, of) for of in (None, *VERSIONS) for name in names(of)]
    registry = Registry([(each["$id"], each) for each in loaded])
    return Draft202012Validator(schema(kind, version), registry=registry)


def each_once(items: list[Any], name: str, requirement: str, pointer: str) -> Iterator[Judgement]:
    """Whether the objects of an array differ in a member, where that is a string."""
    names = [item.get(name) for item in items if isinstance(item, dict)]
    for each, times in Counter(each for each in names if isinstance(each, str)).items():
        if times > 1:
            text = f"{name} {show(each)} is there {times} times"
            yield Judgement(requirement, Breach("not-unique", text), pointer)
