import pytest
from splatbus_schemas.validation import validator, violations

POSE = {
    "type": "camera_pose",
    "position": {"x": 0, "y": 0, "z": 0},
    "rotation": {"x": 0, "y": 0, "z": 0, "w": 1},
}


def test_a_missing_member_is_where_it_is_missing() -> None:
    message = {**POSE, "rotation": {"x": 0, "y": 0, "z": 0}}
    (found,) = violations(message, "camera_pose", "1.0")
    assert found[:4] == ("/rotation/w", ("POS-1",), "w is missing", "required")


def test_each_missing_member_is_a_violation() -> None:
    pointers = [found.pointer for found in violations({}, "camera_pose", "1.0")]
    assert pointers == ["/type", "/position", "/rotation"]


def test_a_missing_member_is_found_behind_a_reference_to_another_schema() -> None:
    message = {**POSE, "type": "point_cloud_pose", "position": {"x": 0, "y": 0}}
    for version in ("1.0", "1.1"):
        (found,) = violations(message, "point_cloud_pose", version)
        assert found.pointer == "/position/z"


def test_a_violation_names_pointer_requirements_and_problem() -> None:
    message = {"position": [0, 1e39, 0], "rotation": [0, 0, 0, 1]}
    (found,) = violations(message, "camera_pose_reply", "1.0")
    assert found.pointer == "/position/1"
    assert found.requirements == ("POS-2", "REQ-5")
    assert "1e+39" in found.problem


def test_pointers_are_escaped() -> None:
    limits = {"$schema": "urn:splatbus:schema:limits", "limits": {"a/b~c": 1}}
    pointers = {found.pointer for found in violations(limits, "limits", None)}
    assert "/limits/a~1b~0c" in pointers


def test_a_validator_is_prepared_once() -> None:
    assert validator("hello", "1.1") is validator("hello", "1.1")


def test_an_unknown_message_is_not_found() -> None:
    with pytest.raises(FileNotFoundError, match="hello"):
        validator("hello", "1.0")
