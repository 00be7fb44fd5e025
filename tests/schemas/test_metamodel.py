"""The metamodel has all messages with all members, and limits, ids and versions that there are."""

from collections.abc import Iterator
from typing import Any

import pytest
from splatbus_schemas import FRAMING, LIMITS, VERSIONS, examples, names, requirements
from splatbus_schemas.model.metamodel import metamodel
from splatbus_schemas.validation import violations

MODEL = metamodel()["versions"]


def record(name: str, version: str = "1.1") -> dict[str, Any]:
    found: dict[str, Any] = MODEL[version]["records"][name]
    return found


def member(of: str, name: str, version: str = "1.1") -> dict[str, Any]:
    (found,) = [each for each in record(of, version)["members"] if each["name"] == name]
    return {key: value for key, value in found.items() if key != "description"}


def shapes() -> Iterator[tuple[str, dict[str, Any]]]:
    for version, model in MODEL.items():
        for each in (each for found in model["records"].values() for each in found["members"]):
            yield version, each
            if "items" in each:
                yield version, each["items"]


def test_it_follows_its_schema() -> None:
    assert violations(metamodel(), "metamodel", None) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_each_message_is_there_with_its_type(version: str) -> None:
    messages = {each["name"]: each for each in MODEL[version]["messages"]}
    assert sorted(messages) == names(version)
    for name, message in messages.items():
        types = {example.message.get("type") for example in examples(name, version)[0]}
        assert types == {message["type"]}, name
        assert message["answers"] is None or message["answers"] in messages
        assert (
            message["capability"] is None or message["capability"] in MODEL[version]["capabilities"]
        )
        assert set(message["channels"]) <= set(FRAMING["channels"])


def test_what_it_names_is_there() -> None:
    for version, shape in shapes():
        assert shape["requirements"]
        assert set(shape["requirements"]) <= set(requirements(version))
        assert set(shape.get("limits", {}).values()) <= set(LIMITS)
        assert "record" not in shape or shape["record"] in MODEL[version]["records"]


def test_the_bounds_that_are_limits_say_which() -> None:
    unnamed = {
        (keyword, shape[keyword])
        for _, shape in shapes()
        for keyword in ("maximum", "maxLength", "maxItems")
        if keyword in shape and keyword not in shape.get("limits", {})
    }
    assert unnamed == {("maxItems", 2), ("maxItems", 3), ("maxItems", 4)}


def test_a_member_is_there_since_the_version_that_brought_it() -> None:
    since = {each["name"]: each["since"] for each in record("CameraPose")["members"]}
    assert since == {
        **dict.fromkeys(("type", "timestamp", "position", "rotation"), "1.0"),
        **dict.fromkeys(("tag", "intrinsics"), "1.1"),
    }
    assert record("CameraPose")["since"] == "1.0"
    assert record("Frame")["since"] == "1.1"


def test_a_member_says_all_that_its_schema_does() -> None:
    assert member("Meta", "offsetColor") == {
        "name": "offsetColor",
        "type": "integer",
        "minimum": 0,
        "maximum": 2**53 - 1,
        "multipleOf": 16,
        "default": 0,
        "limits": {"maximum": "max_safe_integer"},
        "requirements": ["INI-5"],
        "required": False,
        "since": "1.0",
    }
    assert member("CameraPose", "intrinsics")["capability"] == "intrinsics"
    assert member("Position", "x")["requirements"] == ["POS-1", "POS-2"]
    assert member("DepthSemantics", "empty")["or"] == "inf"
    assert member("SceneObject", "bounds")["nullable"]


def test_what_depends_on_the_kind_of_memory_says_so() -> None:
    cuda = {"record": "InitPacket", "member": "memory.kind", "value": "cuda_ipc"}
    assert record("InitPacket")["kinds"] == "memory.kind"
    assert {
        each["name"]: (each["required"], each.get("when"), each.get("requiredWhen"))
        for each in record("InitPacket")["members"]
    } == {
        **dict.fromkeys(
            ("version", "generation", "memory", "semantics", "meta"), (True, None, None)
        ),
        "ring": (False, None, {**cuda, "value": "host_shm"}),
        **dict.fromkeys(("mem_color", "mem_depth", "evt_done"), (True, cuda, None)),
    }
    assert member("Ring", "events")["when"] == cuda
    assert member("Memory", "deviceUuid")["when"] == {**cuda, "record": "Memory", "member": "kind"}


def test_a_member_may_be_two_things() -> None:
    values = [each for each in record("Series")["members"] if each["name"] == "value"]
    assert [(each["type"], each["when"]["value"]) for each in values] == [
        ("number", "scalar"),
        ("string", "text"),
    ]
