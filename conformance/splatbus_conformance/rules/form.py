"""What one message shows by itself: its schema says what is wrong, where, and by which sentence."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

from splatbus_schemas import LIMITS, VERSIONS, names, schema
from splatbus_schemas.validation import violations

from splatbus_conformance.rules import Breach, Json, Judgement, Sighting, judged
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.json_values import finite, finites, show, unspeakable, whole, within

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


def formed(messages: Iterable[Message], *requirements: str) -> Iterator[Sighting]:
    """What each of some messages of 1.1 shows of these requirements by the schema of its kind."""
    for message in messages:
        shown = form(message.members, str(message.kind), *requirements)
        yield from judged(message, shown)


def growing(value: Json, name: str, newest: int, requirement: str) -> Iterator[Judgement]:
    """Whether an integer is greater than the newest before it."""
    number = whole(value.get(name), 0)
    if number is not None and number <= newest:
        text = f"{name} {number} comes after {newest}"
        yield Judgement(requirement, Breach("not-growing", text), f"/{name}")


def far_beyond_near(lens: object, requirement: str, pointer: str) -> Iterator[Judgement]:
    """Whether `far` is beyond `near`, where a lens or a camera has both."""
    near, far = (finite(within(lens, name)) for name in ("near", "far"))
    if near is not None and far is not None and far <= near:
        wrong = Breach("far-before-near", f"far is {show(far)}, near {show(near)}")
        yield Judgement(requirement, wrong, f"{pointer}/far")


def unit_norm(
    rotation: object, requirement: str, pointer: str = "/rotation"
) -> Iterator[Judgement]:
    """Whether four numbers are a unit quaternion, as POS-3 says."""
    if parts := finites(rotation, 4):
        norm, tolerance = math.hypot(*parts), LIMITS["rotation_norm_tolerance"]
        off = not abs(norm - 1) <= tolerance
        text = f"the norm of rotation is {norm:.6g}, further than {tolerance} from 1"
        yield Judgement(requirement, Breach("not-unit-norm", text) if off else None, pointer)


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
