"""Check parsed messages against their schemas.

What JSON Schema cannot say, a schema's `$comment` lists: a message that passes here may still break
that. jsonschema takes NaN and infinities for numbers, so parse strictly first (JSN-4).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple

from jsonschema import Draft202012Validator, ValidationError
from jsonschema.validators import extend
from referencing import Registry
from referencing.jsonschema import DRAFT202012

from splatbus_schemas.data import VERSIONS, names, schema

SHOWN_CHARS = 60
_ID = re.compile(r"\b[A-Z]{3}-\d+\b")


class Violation(NamedTuple):
    """One way in which a message breaks its schema.

    `pointer` (RFC 6901) leads to what is wrong, or to the member that is missing; `requirements`
    are the ids that the broken constraint serves; `problem` says what is there, as JSON, and what
    is wanted; `keyword` is the constraint's, of a `type` the type that is wanted.
    """

    pointer: str
    requirements: tuple[str, ...]
    problem: str
    keyword: str
    value: Any
    """What is there; the object around a member that is missing."""


def violations(message: Any, name: str, version: str | None) -> list[Violation]:
    """Everything in `message` that breaks `schema(name, version)`; empty if nothing does."""
    return [_violation(error) for error in validator(name, version).iter_errors(message)]


def _violation(error: ValidationError) -> Violation:
    keyword = str(error.validator)
    if keyword == "type":
        keyword = next(each for each in _types(error.schema) if each != "null")
    if keyword == "not" and error.validator_value:
        keyword = "pattern"
    return Violation(
        "".join(f"/{_escaped(str(step))}" for step in error.absolute_path),
        tuple(_ID.findall(error.schema.get("description", ""))),
        f"{_name(error.absolute_path)} {_problem(error)}".strip(),
        keyword,
        error.instance,
    )


def _name(path: Iterable[str | int]) -> str:
    """What a person calls a member, or a place in an array."""
    steps = [f"[{step}]" if isinstance(step, int) else str(step) for step in path]
    names = [place for place, step in enumerate(steps) if not step.startswith("[")]
    return "".join(steps[names[-1] :] if names else steps)


def _problem(error: ValidationError) -> str:
    """What is wrong with it, behind its name."""
    keyword, wanted, asked = error.validator, error.validator_value, error.schema
    if keyword == "required":
        return "is missing"
    there = f"is {_shown(error.instance)}"
    if keyword == "const":
        return f"{there}, not {_shown(wanted)}"
    if keyword == "enum":
        return f"{there}, none of {', '.join(map(_shown, wanted))}"
    if keyword == "uniqueItems":
        return f"{there}, in which something is twice"
    if keyword == "contains":
        return f"{there}, in which nothing is as {_shown(wanted.get('properties', wanted))} says"
    if keyword == "not" and not wanted:
        return "is there, and must not be"
    if keyword in ("pattern", "not"):
        return f"{there}, which is not spelled as {_shown(asked.get('pattern', wanted))} says"
    if keyword == "anyOf":
        allowed = (_shown(each["const"]) if "const" in each else _noun(each) for each in wanted)
        return f"{there}, no {' nor '.join(allowed)}"
    null, noun = "null" in _types(asked), _noun(asked)
    article = "an" if noun[0] in "aeio" else "a"
    return f"{there}, neither null nor {article} {noun}" if null else f"{there}, no {noun}"


def _types(asked: Any) -> list[str]:
    listed = asked.get("type", "number")
    return listed if isinstance(listed, list) else [listed]


def _noun(asked: Any) -> str:
    """What a schema asks for, without an article."""
    kind = next((each for each in _types(asked) if each != "null"), "null")
    if kind == "array":
        items = {"number": "numbers", "string": "strings", "integer": "integers"}
        what = items.get(asked.get("items", {}).get("type", ""), "items")
        return f"array of {_range(asked.get('minItems', 0), asked.get('maxItems'))} {what}"
    if kind == "string":
        range_ = _range(asked.get("minLength", 0), asked.get("maxLength"))
        return f"string of {range_} characters" if "maxLength" in asked else "string"
    if "multipleOf" in asked:
        kind = f"multiple of {asked['multipleOf']}"
    for name, word in (
        *(("exclusiveMinimum", "greater than"), ("minimum", "from")),
        *(("exclusiveMaximum", "less than"), ("maximum", "to")),
    ):
        if name in asked:
            kind += f" {word} {asked[name]}"
    return kind


def _range(least: int, most: int | None) -> str:
    if most is None:
        return f"at least {least}" if least else "any number of"
    if not least:
        return f"up to {most:,}"
    return str(least) if least == most else f"{least} to {most:,}"


def _shown(value: Any) -> str:
    """A value as JSON, cut when it is long."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= SHOWN_CHARS else f"{text[: SHOWN_CHARS - 1]}…"


@cache
def validator(name: str, version: str | None) -> Draft202012Validator:
    """The prepared validator of `schema(name, version)`; FileNotFoundError if there is none.

    Its errors about missing members have the path of the member, not that of the object around it.
    """
    return _Validator(schema(name, version), registry=_registry())


def _escaped(step: str) -> str:
    return step.replace("~", "~0").replace("/", "~1")


def _required(
    checker: Draft202012Validator, members: list[str], instance: Any, _schema: Any
) -> Iterator[ValidationError]:
    if checker.is_type(instance, "object"):
        for member in members:
            if member not in instance:
                yield ValidationError(f"{member!r} is missing", path=[member])


_Validator = extend(Draft202012Validator, {"required": _required})


@cache
def _registry() -> Registry[Any]:
    loaded = [schema(name, version) for version in (None, *VERSIONS) for name in names(version)]
    return Registry().with_resources(
        (each["$id"], DRAFT202012.create_resource(_without_dialect(each))) for each in loaded
    )


def _without_dialect(loaded: dict[str, Any]) -> dict[str, Any]:
    # At a `$ref` jsonschema goes on with the stock validator of the `$schema` that it finds there,
    # whose errors about missing members lack the member.
    return {keyword: value for keyword, value in loaded.items() if keyword != "$schema"}
