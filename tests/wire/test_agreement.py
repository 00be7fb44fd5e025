"""Schemas and wire agree: what one refuses the other does, but for what a `$comment` lists."""

import json
import re
from collections.abc import Iterator
from functools import cache, reduce
from itertools import chain
from operator import getitem
from typing import Any

import pytest
from splatbus_schemas import examples, names, schema
from splatbus_schemas.validation import violations
from splatbus_wire.errors import ProtocolError

from tests.wire.test_examples import decode_example, sent_again

# A client bears an error that breaks a rule (NEG-24).
NAMES = sorted(set(names("1.1")) - {"error"})
UNTYPED_REPLIES = ("camera", "viewport_size")
KINDS = ("scalar", "histogram", "text")
UNKNOWN_TYPES = {"NEG-9", "INI-11"}
ABSENT = object()
NUMBERS = (-1, 0, 0.5, 7.0, 1024, 32_769, 1e10, 3.4028235677973366e38, 1e39, 2**53)
ITEMS = 4
REPLACEMENTS = [ABSENT, None, True, "", "x", "1", "inf", *NUMBERS, [], [1], {}]


@cache
def left_to_other_checks(name: str, version: str = "1.1") -> set[str]:
    """The ids in the `$comment` of a schema, and of those of 1.0 that it refers to."""
    loaded = schema(name, version)
    former = set(re.findall(r"schema:1\.0:(\w+)\"", json.dumps(loaded))) if version != "1.0" else ()
    ids = set(re.findall(r"[A-Z]{3}-\d+", loaded["$comment"]))
    return ids.union(*(left_to_other_checks(each, "1.0") for each in former))


def is_borne(name: str, message: Any) -> bool:
    """Whether a client takes what no server may send: an untyped reply, an unknown series."""
    if name in UNTYPED_REPLIES:
        return "type" not in message
    return name == "telemetry" and any(each["kind"] not in KINDS for each in message["series"])


def refused_for(name: str, message: Any) -> str | None:
    """The requirement that the wire names, None where it takes the message."""
    try:
        decode_example(name, message, said_hello=True)
    except ProtocolError as error:
        return error.requirement
    return None


def places(value: Any, way: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every value inside of this one."""
    inside = value.items() if isinstance(value, dict) else enumerate(value)
    for step, inner in inside:
        yield (*way, step)
        if isinstance(inner, dict | list):
            yield from places(inner, (*way, step))


def covering(messages: list[Any]) -> Iterator[Any]:
    """Those of the messages that have a place which none before has, unless it is a long one."""
    seen: set[tuple[Any, ...]] = set()
    for message in messages:
        found = set(places(message))
        if len(found) < 100 and not found <= seen:
            seen |= found
            yield message


def damaged(message: Any) -> Iterator[Any]:
    """The message with each value in it replaced in many ways, and with each left out; of a list,
    with the first few items: to what reads it, all that follow are the same.
    """
    for *way, last in places(message):
        if any(isinstance(step, int) and step >= ITEMS for step in (*way, last)):
            continue
        for new in REPLACEMENTS:
            copy = json.loads(json.dumps(message))
            place = reduce(getitem, way, copy)
            if new is ABSENT:
                del place[last]
            else:
                place[last] = new
            yield copy


def damaged_examples(name: str) -> Iterator[Any]:
    valid = [example.message for example in examples(name, "1.1")[0]]
    return chain.from_iterable(map(damaged, covering(valid)))


@pytest.mark.parametrize("name", NAMES)
def test_the_wire_refuses_what_a_schema_refuses_and_hardly_more(name: str) -> None:
    for message in damaged_examples(name):
        if name == "init_packet" and message.get("version") not in ("1.1", "1.2"):
            continue  # it is one of 1.0, or of a version that is not known
        requirement, violated = refused_for(name, message), violations(message, name, "1.1")
        if requirement is None:
            assert not violated or is_borne(name, message), message
            if not violated:
                sent_again(name, decode_example(name, message, said_hello=True), "1.1")
        else:
            named = {each for violation in violated for each in violation.requirements}
            assert requirement in named | left_to_other_checks(name) | UNKNOWN_TYPES, message
