import copy
import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
from splatbus_schemas import FRAMING, LIMITS, VERSIONS, examples, names, read_json, schema
from splatbus_schemas.validation import violations

DATA_FILES = [
    ("framing", ("framing.json",)),
    ("limits", ("limits.json",)),
    ("messages", ("messages.json",)),
    *(("requirements", (version, "requirements.json")) for version in VERSIONS),
]


def test_names_are_those_of_the_messages_of_a_version() -> None:
    requests = ["get_camera_pose", "get_viewport_size"]
    poses = ["camera_pose", "point_cloud_pose"]
    replies = ["camera_pose_reply", "viewport_size_reply"]
    assert names("1.0") == sorted(["init_packet", *poses, *requests, *replies])
    of_images = "hello welcome error opened open_failed closed frame release subscribe"
    of_scenes = "object_pose set_time get_scene set_viewport ping subscribe_telemetry telemetry"
    typed_replies = "camera viewport_size scene pong"
    new = f"{of_images} {of_scenes} {typed_replies}".split()
    assert names("1.1") == sorted(["init_packet", *poses, *requests, *new])


def test_names_of_no_version_are_those_of_the_data_files() -> None:
    assert names(None) == ["framing", "limits", "messages", "metamodel", "requirements"]


@pytest.mark.parametrize(("name", "version"), [("hello", "1.0"), ("limits", "1.1"), ("pose", None)])
def test_an_unknown_schema_is_not_found(name: str, version: str | None) -> None:
    with pytest.raises(FileNotFoundError, match=name):
        schema(name, version)


def test_examples_come_apart_into_valid_and_invalid_ones() -> None:
    valid, invalid = examples("get_viewport_size", "1.0")
    assert valid[0].message == {"type": "get_viewport_size"}
    assert {"REQ-1", "POS-8"} == {example.requirement for example in invalid}


@pytest.mark.parametrize(("name", "path"), DATA_FILES)
def test_data_files_follow_their_schema(name: str, path: tuple[str, ...]) -> None:
    loaded = read_json(*path)
    assert violations(loaded, name, None) == []
    assert loaded["$schema"] == schema(name, None)["$id"] == f"urn:splatbus:schema:{name}"


def _without_value(data: Any) -> None:
    del data["limits"]["max_slots"]["value"]


def _with_a_typing_error(data: Any) -> None:
    data["limits"]["max_slots"]["unti"] = "slots"


def _from_a_version_to_come(data: Any) -> None:
    data["limits"]["max_slots"]["since"] = "9.9"


@pytest.mark.parametrize(
    "break_it", [_without_value, _with_a_typing_error, _from_a_version_to_come]
)
def test_the_schema_of_limits_is_no_formality(break_it: Callable[[Any], None]) -> None:
    data = copy.deepcopy(read_json("limits.json"))
    break_it(data)
    assert violations(data, "limits", None)


def test_constants_are_read_only_and_those_of_the_files() -> None:
    assert LIMITS["max_payload_bytes"] == 1 << 20
    assert FRAMING["channels"]["ipc"]["defaultPort"] == 6001
    for constants in (LIMITS, FRAMING):
        with pytest.raises(TypeError):
            constants["max_slots"] = 2  # type: ignore[index]


def test_importing_the_package_does_not_import_jsonschema() -> None:
    code = "import json, sys, splatbus_schemas; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, text=True, timeout=60
    )
    loaded = json.loads(done.stdout)
    assert "splatbus_schemas" in loaded
    assert "jsonschema" not in loaded
