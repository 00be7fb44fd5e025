"""The schemas of the messages against the hand-written examples, the limits and the ids."""

import json
import math
import re
from collections.abc import Iterator
from typing import Any

import pytest
from jsonschema import Draft202012Validator, ValidationError
from splatbus_schemas import (
    LIMITS,
    VERSIONS,
    InvalidExample,
    ValidExample,
    examples,
    names,
    read_json,
    requirements,
    schema,
)
from splatbus_schemas.validation import validator, violations

MESSAGES = [(name, version) for version in VERSIONS for name in names(version)]
VALID = [(*m, e) for m in MESSAGES for e in examples(*m)[0]]
INVALID = [(*m, e) for m in MESSAGES for e in examples(*m)[1]]

ANNOTATIONS = {*"$schema $id $comment title description default contentEncoding".split()}
APPLICATORS = {*"$ref $defs properties items allOf if then else".split()}
CONSTRAINTS = {
    *"type const enum required not minimum maximum exclusiveMinimum multipleOf".split(),
    *"minLength maxLength pattern minItems maxItems uniqueItems contains anyOf".split(),
}
IDS = re.compile(r"\b[A-Z]{3}-\d+\b")


def label(value: object) -> str | None:
    return value.why if isinstance(value, ValidExample | InvalidExample) else None


def nodes(node: dict[str, Any], where: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every subschema that constrains, with its place; the condition of an `if` only chooses."""
    yield where, node
    for group in ("properties", "$defs"):
        for name, inner in node.get(group, {}).items():
            yield from nodes(inner, f"{where}/{group}/{name}")
    for keyword in {"items", "then", "else"} & set(node):
        yield from nodes(node[keyword], f"{where}/{keyword}")
    for index, inner in enumerate(node.get("allOf", ())):
        yield from nodes(inner, f"{where}/allOf/{index}")


def constraints(node: dict[str, Any]) -> Iterator[tuple[str, str | None]]:
    """The constraints of one node; each member that is required counts as one."""
    for keyword in CONSTRAINTS & set(node):
        for member in node[keyword] if keyword == "required" else [None]:
            yield keyword, member


def broken_constraint(error: ValidationError) -> tuple[str, str, str | None]:
    member = str(error.absolute_path[-1]) if error.validator == "required" else None
    return json.dumps(error.schema), error.validator, member


def own_nodes() -> list[tuple[str, str, str, dict[str, Any]]]:
    return [(*m, where, node) for m in MESSAGES for where, node in nodes(schema(*m))]


@pytest.mark.parametrize(("name", "version", "example"), VALID, ids=label)
def test_what_the_prose_allows_validates(name: str, version: str, example: Any) -> None:
    assert violations(example.message, name, version) == []


@pytest.mark.parametrize(("name", "version", "example"), INVALID, ids=label)
def test_what_the_prose_forbids_fails_there_and_for_that_reason(
    name: str, version: str, example: Any
) -> None:
    found = violations(example.message, name, version)
    assert found
    assert {violation.pointer for violation in found} == {example.pointer}
    assert all(example.requirement in violation.requirements for violation in found)


@pytest.mark.parametrize(("name", "version"), MESSAGES)
def test_there_are_examples_enough(name: str, version: str) -> None:
    valid, invalid = examples(name, version)
    assert len(valid) >= 3
    assert len(invalid) >= 3
    texts = [json.dumps(example.message) for example in valid + invalid]
    assert len(set(texts)) == len(texts)


@pytest.mark.parametrize(("name", "version"), MESSAGES)
def test_each_constraint_is_broken_by_an_example(name: str, version: str) -> None:
    broken = {
        broken_constraint(error)
        for example in examples(name, version)[1]
        for error in validator(name, version).iter_errors(example.message)
    }
    for where, node in nodes(schema(name, version)):
        for keyword, member in constraints(node):
            assert (json.dumps(node), keyword, member) in broken, f"{where}: {keyword} {member}"


@pytest.mark.parametrize(("name", "version"), MESSAGES)
def test_unknown_members_are_allowed_at_every_level(name: str, version: str) -> None:
    def with_unknown(value: Any) -> Any:
        if isinstance(value, dict):
            return {"x-unknown": [None], **{k: with_unknown(v) for k, v in value.items()}}
        return [with_unknown(item) for item in value] if isinstance(value, list) else value

    for example in examples(name, version)[0]:
        assert violations(with_unknown(example.message), name, version) == []


@pytest.mark.parametrize(("name", "version"), MESSAGES)
def test_a_schema_says_what_it_is(name: str, version: str) -> None:
    loaded = schema(name, version)
    Draft202012Validator.check_schema(loaded)
    assert loaded["$id"] == f"urn:splatbus:schema:{version}:{name}"
    assert loaded["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    assert loaded["title"]
    assert loaded["$comment"].startswith("Left to other checks: ")


def test_only_known_keywords_are_used() -> None:
    used = {keyword for *_, node in own_nodes() for keyword in node}
    assert used <= ANNOTATIONS | APPLICATORS | CONSTRAINTS


def test_each_constraint_names_a_requirement_in_force() -> None:
    for name, version, where, node in own_nodes():
        ids = IDS.findall(node.get("description", ""))
        if CONSTRAINTS & set(node):
            assert ids, f"{version}/{name}{where} names no requirement"
        mentioned = set(ids) | set(IDS.findall(node.get("$comment", "")))
        assert mentioned <= set(requirements(version)), f"{version}/{name}{where}"


def test_each_bound_is_a_limit_of_the_requirement_that_it_names() -> None:
    limits = read_json("limits.json")["limits"].values()
    for name, version, where, node in own_nodes():
        ids = set(IDS.findall(node.get("description", "")))
        allowed = {limit["value"] for limit in limits if ids & set(limit["requirements"])}
        has_fixed_size = node.get("minItems") == node.get("maxItems")
        bounds: dict[str, Any] = {key: node[key] for key in ("maximum", "maxLength") if key in node}
        bounds |= {"minimum": -node["minimum"]} if node.get("minimum", 0) < 0 else {}
        bounds |= (
            {"maxItems": node["maxItems"]} if "maxItems" in node and not has_fixed_size else {}
        )
        for keyword, bound in bounds.items():
            assert bound in allowed, f"{version}/{name}{where}/{keyword} is {bound}"


def test_patterns_mean_the_same_to_every_regular_expression() -> None:
    """Without groups that some lack; where `$` may stand before a line break, one is forbidden."""
    for name, version, where, node in own_nodes():
        if "pattern" in node:
            assert "(?" not in node["pattern"]
            assert node["not"] == {"pattern": "[^!-~]"}, f"{version}/{name}{where}"


def test_a_handle_has_the_length_of_its_bytes_in_base64() -> None:
    size = LIMITS["handle_bytes"]
    digits, padding = math.ceil(size * 8 / 6), -size % 3
    memory = schema("init_packet", "1.1")["$defs"]["cudaMemory"]
    for handle in schema("init_packet", "1.0")["$defs"]["handle"], memory["properties"]["handle"]:
        assert handle["pattern"] == f"^[A-Za-z0-9+/]{{{digits}}}{'=' * padding}$"


def test_a_version_is_spelt_alike_wherever_it_stands() -> None:
    listed, supported = (schema(name, "1.1")["$defs"]["version"] for name in ("hello", "error"))
    spoken = schema("welcome", "1.1")["properties"]["version"]
    for keyword in ("type", "maxLength", "pattern"):
        assert listed[keyword] == supported[keyword] == spoken[keyword]
