"""Members that many messages of 1.1 have, judged by the requirement on their message."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from splatbus_conformance.rules import Breach, Judgement
from splatbus_conformance.wire.json_values import (
    MAX_CHARS,
    SAFE,
    integer_in,
    is_number,
    numbers,
    show,
    text_of,
)

Json = dict[str, Any]


def named(value: Json, name: str, requirement: str, pointer: str, *, least: int = 1) -> Judgement:
    """Whether a member is a string of `least` to 64 characters."""
    has = show(value[name]) if name in value else "missing"
    text = f"{name} is {has}, no string of {least} to {MAX_CHARS} characters"
    fits = text_of(value.get(name), least, MAX_CHARS)
    return Judgement(requirement, None if fits else Breach("bad-string", text), f"{pointer}/{name}")


def number(value: Json, name: str, requirement: str, pointer: str) -> Judgement:
    """Whether a member is a number."""
    has = show(value[name]) if name in value else "missing"
    wrong = Breach("not-a-number", f"{name} is {has}, no number")
    fits = is_number(value.get(name))
    return Judgement(requirement, None if fits else wrong, f"{pointer}/{name}")


def vector(value: Json, name: str, requirement: str, pointer: str, *, count: int = 3) -> Judgement:
    """Whether a member is an array of so many numbers."""
    has = show(value[name]) if name in value else "missing"
    wrong = Breach("not-an-array", f"{name} is {has}, no array of {count} numbers")
    fits = numbers(value.get(name), count)
    return Judgement(requirement, None if fits else wrong, f"{pointer}/{name}")


def count(value: Json, name: str, requirement: str, pointer: str) -> Judgement:
    """Whether a member is an integer from 0."""
    has = show(value[name]) if name in value else "missing"
    wrong = Breach("out-of-range", f"{name} is {has}, no integer from 0 to {SAFE}")
    fits = integer_in(value.get(name), 0)
    return Judgement(requirement, None if fits else wrong, f"{pointer}/{name}")


def each_once(items: list[Any], name: str, requirement: str, pointer: str) -> Iterator[Judgement]:
    """Whether the objects of an array differ in a member, where that is a string."""
    names = [item.get(name) for item in items if isinstance(item, dict)]
    for each, times in Counter(each for each in names if isinstance(each, str)).items():
        if times > 1:
            text = f"{name} {show(each)} is there {times} times"
            yield Judgement(requirement, Breach("not-unique", text), pointer)
