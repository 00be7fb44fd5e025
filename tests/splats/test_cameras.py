"""`cameras.json` of 3DGS becomes poses and lenses of the wire."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from splatbus_splats.files.cameras import read_cameras

CAMERA = {
    "id": 0, "img_name": "00001", "width": 640, "height": 480, "position": [1, 2, 3],
    "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]], "fx": 500.5, "fy": 501,
}  # fmt: skip


def test_cameras_are_read(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps([CAMERA, CAMERA | {"img_name": "b"}]))
    first, second = read_cameras(path, 0.2, 50)
    assert (first.name, second.name) == ("00001", "b")
    assert first.pose == ((1, 2, 3), (0.5, 0.5, 0.5, 0.5))  # the camera's z is the world's x
    assert first.lens == (500.5, 501, 320, 240, 640, 480, 0.2, 50)


def test_what_is_only_a_label_may_be_missing(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    camera = {k: v for k, v in CAMERA.items() if k not in ("id", "img_name")}
    path.write_text(json.dumps([camera | {"width": 640.0}]))
    (found,) = read_cameras(path)
    assert found.name == "its picture"
    assert found.lens[4:6] == (640, 480)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "camera 1: width is 0"),
        ({"width": 640.5}, "camera 1: width is 640.5"),
        ({"fx": -1}, "camera 1: fx and fy"),
        ({"fy": "1"}, "camera 1: fy has '1'"),
        ({"position": [1, 2]}, "camera 1: position is no list of three"),
        ({"position": [1, 2, 10**400]}, "camera 1: position has a number that is not finite"),
        ({"rotation": [[1, 0, 0], [0, 1, 0]]}, "camera 1: rotation is no matrix"),
        ({"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "camera 1: rotation .* reflection"),
        ({"rotation": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "camera 1: rotation .* not orthogonal"),
    ],
)
def test_a_camera_that_is_none_is_refused(tmp_path: Path, change: object, message: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps([CAMERA, {**CAMERA, **change}]))  # type: ignore[dict-item]
    with pytest.raises(ValueError, match=f"^{path}: {message}"):
        read_cameras(path)


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", "[1]", "[{}]", "[" * 100_000, '[{"a": 1}', "\xff"]
)
def test_another_file_is_no_cameras(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(text, "latin-1")
    with pytest.raises(ValueError, match=f"^{path}: "):
        read_cameras(path)
