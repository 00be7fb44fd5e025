"""A bundle stands alone, and says of each message what the schemas of the messages say."""

import copy
import re
from collections.abc import Iterator
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from splatbus_schemas import VERSIONS, examples, names, read_json
from splatbus_schemas.model.parts import added, camel
from splatbus_schemas.validation import validator

MESSAGES = [(name, version) for version in VERSIONS for name in names(version)]
CHANGES = (5, "x", None)


def definition(name: str, version: str) -> Draft202012Validator:
    bundle = read_json(version, "bundle.json")
    only_one = [{"$ref": f"#/$defs/{camel(name)}"}]
    return Draft202012Validator({**bundle, "anyOf": only_one})


def places(value: Any, *path: str | int) -> Iterator[tuple[str | int, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    for key, each in inner:
        yield (*path, key)
        if isinstance(each, dict | list):
            yield from places(each, *path, key)


def changed(message: Any) -> Iterator[Any]:
    """The message with each value in it left out, and replaced by others."""
    for *path, last in places(message):
        for change in range(len(CHANGES) + 1):
            other = copy.deepcopy(message)
            parent = other
            for step in path:
                parent = parent[step]
            if change < len(CHANGES):
                parent[last] = CHANGES[change]
            else:
                del parent[last]
            yield other


@pytest.mark.parametrize("version", VERSIONS)
def test_it_refers_to_itself_only(version: str) -> None:
    bundle = read_json(version, "bundle.json")
    Draft202012Validator.check_schema(bundle)
    references = re.findall(r"'\$ref': '([^']*)'", str(bundle))
    assert {reference.removeprefix("#/$defs/") for reference in references} <= set(bundle["$defs"])


@pytest.mark.parametrize("version", VERSIONS)
def test_each_definition_is_called_by_its_title(version: str) -> None:
    bundle = read_json(version, "bundle.json")
    assert {camel(name) for name in names(version)} <= set(bundle["$defs"])
    for name, node in bundle["$defs"].items():
        assert node["title"] == name
        assert re.fullmatch(r"([A-Z][a-z]+)+", name)
        assert node["description"]


@pytest.mark.parametrize(("name", "version"), MESSAGES)
def test_it_takes_and_refuses_what_the_schema_does(name: str, version: str) -> None:
    alone, bundled = validator(name, version), definition(name, version)
    valid, invalid = examples(name, version)
    for right in valid:
        assert bundled.is_valid(right.message), right.why
    for wrong in invalid:
        assert not bundled.is_valid(wrong.message), wrong.why
    for message in (other for right in valid[:3] for other in changed(right.message)):
        assert bundled.is_valid(message) == alone.is_valid(message), message


@pytest.mark.parametrize(
    ("version", "name", "member", "type_of_it"),
    [
        ("1.0", "InitPacket", "meta", "Meta"),
        ("1.0", "CameraPose", "position", "Position"),
        ("1.0", "CameraPose", "rotation", "Rotation"),
        ("1.1", "HostShmInitPacket", "meta", "Meta"),
        ("1.1", "HostShmInitPacket", "memory", "HostShmMemory"),
        ("1.1", "HostShmInitPacket", "ring", "Ring"),
        ("1.1", "CudaIpcInitPacket", "meta", "Meta"),
        ("1.1", "CudaIpcInitPacket", "ring", "CudaIpcRing"),
        ("1.1", "CudaIpcInitPacket", "semantics", "Semantics"),
        ("1.1", "Frame", "camera", "FrameCamera"),
        ("1.1", "Welcome", "server", "Program"),
    ],
)
def test_what_is_an_object_has_a_type(
    version: str, name: str, member: str, type_of_it: str
) -> None:
    found = read_json(version, "bundle.json")["$defs"][name]
    assert found["properties"][member] == {"$ref": f"#/$defs/{type_of_it}"}
    assert member in found["required"] or member == "ring"


def test_two_types_of_one_name_are_told() -> None:
    found = {"Pose": {"title": "Pose", "description": "a camera's"}}
    added(found, "Pose", {"title": "Pose", "description": "an object's"}, {"description"})
    with pytest.raises(ValueError, match="two types would be called Pose"):
        added(found, "Pose", {"title": "Pose", "required": ["x"]}, {"description"})
