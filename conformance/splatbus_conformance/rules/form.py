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
    **dict.fromkeys(("minimum", "maximum", "multipleOf"), "out-of-range"),
    **dict.fromkeys(("exclusiveMinimum", "exclusiveMaximum"), "out-of-range"),
    **dict.fromkeys(("string", "minLength", "maxLength", "pattern"), "bad-string"),
    **dict.fromkeys(("array", "minItems", "maxItems"), "not-an-array"),
    "object": "not-an-object",
    "uniqueItems": "not-unique",
    "not": "stray-member",
}
"""The code of a breach, by what of the schema is broken."""
OF_NUMBERS = (
    *("number", "integer", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"),
    *("multipleOf", "anyOf"),
)
"""What a number that is not finite does not break: JSN-4 says what is wrong with it."""


def form(value: Json, kind: str, *requirements: str, version: str = "1.1") -> Iterator[Judgement]:
    """What a message shows of these requirements by the schema of its kind."""
    yield from map(Judgement, requirements)
    if _is_sound(value, kind, version):
        return
    for pointer, named, problem, keyword, found in violations(value, kind, version):
        if unspeakable(found) and keyword in OF_NUMBERS:
            continue
        for name in requirements:
            if name in named:
                yield Judgement(name, Breach(CODES[keyword], problem), pointer)


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
    from jsonschema_rs import Draft202012Validator

    return Draft202012Validator(schema(kind, version), registry=_registry())


@cache
def _registry() -> Any:
    from jsonschema_rs import Registry

    loaded = [schema(name, of) for of in (None, *VERSIONS) for name in names(of)]
    return Registry([(each["$id"], each) for each in loaded])


def each_once(items: list[Any], name: str, requirement: str, pointer: str) -> Iterator[Judgement]:
    """Whether the objects of an array differ in a member, where that is a string."""
    told = (item.get(name) for item in items if isinstance(item, dict))
    for each, times in Counter(each for each in told if isinstance(each, str)).items():
        if times > 1:
            text = f"{name} {show(each)} is there {times} times"
            yield Judgement(requirement, Breach("not-unique", text), pointer)
