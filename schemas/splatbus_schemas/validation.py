"""Check parsed messages against their schemas.

What JSON Schema cannot say, a schema's `$comment` lists: a message that passes here may still break
that. jsonschema takes NaN and infinities for numbers, so parse strictly first (JSN-4).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from jsonschema import Draft202012Validator, ValidationError
from jsonschema.validators import extend
from referencing import Registry
from referencing.jsonschema import DRAFT202012

from splatbus_schemas.data import VERSIONS, names, schema

_ID = re.compile(r"\b[A-Z]{3}-\d+\b")


class Violation(NamedTuple):
    """One way in which a message breaks its schema.

    `pointer` (RFC 6901) leads to what is wrong, or to the member that is missing; `requirements`
    are the ids that the broken constraint serves.
    """

    pointer: str
    requirements: tuple[str, ...]
    problem: str


def violations(message: Any, name: str, version: str | None) -> list[Violation]:
    """Everything in `message` that breaks `schema(name, version)`; empty if nothing does."""
    return [
        Violation(
            "".join(f"/{_escaped(str(step))}" for step in error.absolute_path),
            tuple(_ID.findall(error.schema.get("description", ""))),
            error.message,
        )
        for error in validator(name, version).iter_errors(message)
    ]


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
