"""What 3DGS and others write is read as they mean it, and what is no splat file is told plainly."""

from __future__ import annotations

import json
import math
import tracemalloc
from pathlib import Path

import numpy as np
import plyfile
import pytest
from splatbus_splats.files import ply, splat
from splatbus_splats.files.cameras import read_cameras
from splatbus_splats.files.read import STEP, read, sequence
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made, main

PROPERTIES = ("x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 {} opacity scale_0 scale_1 scale_2 "
              "rot_0 rot_1 rot_2 rot_3")  # fmt: skip


def rows(count: int, rest: int, **values: float) -> np.ndarray:
    names = PROPERTIES.format(" ".join(f"f_rest_{i}" for i in range(rest))).split()
    table = np.zeros(count, [(name, "f4") for name in names])
    table["rot_0"] = 1
    for name, value in values.items():
        table[name] = value
    return table


def saved(path: Path, table: np.ndarray, text: bool = False, order: str = "<") -> Path:
    element = plyfile.PlyElement.describe(table, "vertex")
    plyfile.PlyData([element], text=text, byte_order=order).write(str(path))
    return path


def refusal(path: Path) -> str:
    with pytest.raises(ValueError, match=f"^{path}: ") as caught:
        read(path)
    return str(caught.value).removeprefix(f"{path}: ")


@pytest.mark.parametrize(("text", "order"), [(True, "<"), (False, "<"), (False, ">")])
def test_a_vertex_means_what_3dgs_means(tmp_path: Path, text: bool, order: str) -> None:
    rest = {f"f_rest_{i}": float(i) for i in range(9)}
    table = rows(
        1, 9, x=1, y=2, z=3, f_dc_0=0.1, f_dc_1=0.2, f_dc_2=0.3, opacity=math.log(3), scale_0=0,
        scale_1=math.log(2), scale_2=-math.inf, rot_0=2, rot_1=0, rot_2=0, rot_3=-2, **rest,
    )  # fmt: skip
    found, left_out = read(saved(tmp_path / "a.ply", table, text, order))
    assert not left_out
    np.testing.assert_array_equal(found.means, [[1, 2, 3]])
    np.testing.assert_allclose(found.opacities, [0.75], rtol=1e-6)
    np.testing.assert_allclose(found.scales, [[1, 2, 0]], rtol=1e-6)
    np.testing.assert_allclose(found.rotations, [[0, 0, -(0.5**0.5), 0.5**0.5]], rtol=1e-6)
    np.testing.assert_allclose(found.coefficients[0, 0], [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_array_equal(found.coefficients[0, 1:], [[0, 3, 6], [1, 4, 7], [2, 5, 8]])
    assert all(getattr(found, name).dtype == np.float32 for name in Gaussians.__annotations__)


@pytest.mark.parametrize("degree", range(4))
def test_what_is_written_is_read_again(tmp_path: Path, degree: int) -> None:
    scene = made(STEP + 3 if degree == 0 else 300, degree)
    ply.write(tmp_path / "a.ply", scene)
    found, left_out = read(tmp_path / "a.ply")
    assert not left_out
    assert (len(found), found.degree) == (len(scene), degree)
    np.testing.assert_array_equal(found.means, scene.means)
    np.testing.assert_array_equal(found.coefficients, scene.coefficients)
    np.testing.assert_allclose(found.scales, scene.scales, rtol=2e-6)
    np.testing.assert_allclose(found.opacities, scene.opacities, atol=1e-6)
    np.testing.assert_allclose(found.rotations, scene.rotations, atol=2e-7)


def test_a_splat_is_read(tmp_path: Path) -> None:
    record = np.zeros(1, splat.RECORD)
    record["mean"], record["scale"] = [[1, 2, 3]], [[0.5, 0, 4]]
    record["rgba"], record["turn"] = [[255, 0, 51, 255]], [[128, 128, 255, 128]]
    record.tofile(tmp_path / "a.splat")
    found, left_out = read(tmp_path / "a.splat")
    assert not left_out
    np.testing.assert_array_equal(found.means, [[1, 2, 3]])
    np.testing.assert_array_equal(found.scales, [[0.5, 0, 4]])
    np.testing.assert_array_equal(found.opacities, [1])
    np.testing.assert_array_equal(found.rotations, [[0, 1, 0, 0]])
    shown = 0.5 + 0.28209479177387814 * found.coefficients[0, 0]
    np.testing.assert_allclose(shown, [1, 0, 0.2], atol=1e-7)


def test_a_splat_that_is_written_is_read_again(tmp_path: Path) -> None:
    scene = made(500, 0)
    splat.write(tmp_path / "a.splat", scene)
    found, _ = read(tmp_path / "a.splat")
    np.testing.assert_array_equal(found.scales, scene.scales)
    np.testing.assert_allclose(found.opacities, scene.opacities, atol=0.5 / 255 + 1e-6)
    same = np.abs((found.rotations * scene.rotations).sum(axis=1))
    assert same.min() > 0.999


BAD = {
    "position not finite": {"y": math.nan},
    "scale not finite": {"scale_1": 1000.0},
    "opacity not a number": {"opacity": math.nan},
    "harmonics not finite": {"f_rest_3": -math.inf},
    "quaternion not finite": {"rot_2": math.inf},
    "quaternion zero": {"rot_0": 0.0},
}


def test_what_is_no_gaussian_is_left_out_and_counted(tmp_path: Path) -> None:
    table = rows(STEP + 20, 9)
    table["x"] = np.arange(len(table))
    for place, values in enumerate(BAD.values()):
        for name, value in values.items():
            table[name][2 * place + 1] = value
    table["opacity"][STEP + 4], table["opacity"][STEP + 5] = math.inf, -math.inf
    table["rot_0"][STEP + 1 : STEP + 3] = math.nan
    found, left_out = read(saved(tmp_path / "a.ply", table))
    assert left_out == dict.fromkeys(BAD, 1) | {"quaternion not finite": 3}
    bad = {2 * place + 1 for place in range(len(BAD))} | {STEP + 1, STEP + 2}
    assert found.means[:, 0].tolist() == [i for i in range(len(table)) if i not in bad]
    assert found.opacities[found.means[:, 0] == STEP + 4].tolist() == [1]
    assert found.opacities[found.means[:, 0] == STEP + 5].tolist() == [0]


def test_a_negative_scale_of_a_splat_is_left_out(tmp_path: Path) -> None:
    record = np.zeros(3, splat.RECORD)
    record["scale"][1, 2] = -1
    record["turn"][2] = 128
    record.tofile(tmp_path / "a.splat")
    found, left_out = read(tmp_path / "a.splat")
    assert len(found) == 1
    assert left_out == {"scale negative": 1, "quaternion zero": 1}


@pytest.mark.parametrize("factor", [1e-30, 1e-3, 1e30])
def test_a_quaternion_of_any_norm_is_a_rotation(tmp_path: Path, factor: float) -> None:
    table = rows(1, 0, rot_0=3 * factor, rot_1=4 * factor)
    found, _ = read(saved(tmp_path / "a.ply", table))
    np.testing.assert_allclose(found.rotations, [[0.8, 0, 0, 0.6]], rtol=1e-6)


def test_a_mesh_is_no_splat_file(tmp_path: Path) -> None:
    points = np.zeros(3, [(name, "f4") for name in "xyz"])
    message = refusal(saved(tmp_path / "mesh.ply", points))
    assert message.startswith("no splat file: its vertices have no property f_dc_0")


def test_a_compressed_file_is_said_to_be_one(tmp_path: Path) -> None:
    points = np.zeros(3, [("packed_position", "u4")])
    assert "compressed" in refusal(saved(tmp_path / "a.ply", points))


@pytest.mark.parametrize("rest", [1, 3, 10, 44, 46, 72])
def test_wrong_numbers_of_harmonics_are_refused(tmp_path: Path, rest: int) -> None:
    message = refusal(saved(tmp_path / "a.ply", rows(2, rest)))
    assert message == f"{rest} properties f_rest_*, where there are 0, 9, 24, 45"


def test_a_harmonic_of_another_number_is_named(tmp_path: Path) -> None:
    table = rows(2, 9)
    table.dtype.names = [name.replace("f_rest_4", "f_rest_9") for name in table.dtype.names]
    assert "no f_rest_4" in refusal(saved(tmp_path / "a.ply", table))


def test_a_list_is_no_number(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 1\n"
    names = [name for name in rows(1, 0).dtype.names if name != "opacity"]
    header += "".join(f"property float {name}\n" for name in names)
    header += "property list uchar float opacity\nend_header\n"
    path = tmp_path / "a.ply"
    path.write_text(header + "0 " * len(names) + "1 0.5\n")
    assert refusal(path) == "the property opacity is a list, and not a number"


@pytest.mark.parametrize("text", [False, True])
def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path: Path, text: bool) -> None:
    whole = saved(tmp_path / "whole.ply", rows(4, 0), text).read_bytes()
    path = tmp_path / "a.ply"
    places = {0, 1, 3, 10, 100, whole.index(b"end_header"), len(whole) // 2, len(whole) - 3}
    for place in sorted(places):
        path.write_bytes(whole[:place])
        assert refusal(path)
    path.write_bytes(whole[: -40 if text else -68])
    assert "early end-of-" in refusal(path)
    if not text:
        assert refusal(path).endswith(f"; the file ends at byte {len(whole) - 68}")


def test_more_vertices_than_the_file_holds_take_no_memory(tmp_path: Path) -> None:
    whole = saved(tmp_path / "a.ply", rows(4, 0)).read_bytes()
    path = tmp_path / "b.ply"
    for count in (b"5", b"1000000000", b"99999999999999999999"):
        path.write_bytes(whole.replace(b"element vertex 4", b"element vertex " + count))
        assert refusal(path)


@pytest.mark.parametrize("name", ["a.ply", "a.splat"])
def test_an_empty_file_is_said_to_be_empty(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    assert refusal(tmp_path / name) == "the file is empty"


def test_no_vertices_are_an_empty_scene(tmp_path: Path) -> None:
    found, left_out = read(saved(tmp_path / "a.ply", rows(0, 9)))
    assert (len(found), found.bounds, left_out) == (0, None, {})


@pytest.mark.parametrize("content", [b"PK\x03\x04 a zip", b"\xff\xd8\xff\xe0 a picture", b"ply\n"])
def test_another_kind_of_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(content)
    assert refusal(path)


def test_a_splat_that_is_cut_short_is_refused_at_its_byte(tmp_path: Path) -> None:
    path = tmp_path / "a.splat"
    path.write_bytes(bytes(70))
    assert "the Gaussian at byte 64 is cut short" in refusal(path)


def test_another_name_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(bytes(64))
    assert "neither .ply nor .splat" in refusal(path)


def test_reading_takes_memory_for_one_copy(tmp_path: Path) -> None:
    ply.write(tmp_path / "a.ply", made(200_000, 3))
    size = (tmp_path / "a.ply").stat().st_size
    tracemalloc.start()
    try:
        read(tmp_path / "a.ply")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1.5 * size  # and the file, which is mapped: 2.5 together


def test_progress_is_told_to_the_end(tmp_path: Path) -> None:
    splat.write(tmp_path / "a.splat", made(2 * STEP + 1, 0))
    told: list[tuple[int, int]] = []
    read(tmp_path / "a.splat", lambda *done: told.append(done))
    whole = 2 * STEP + 1
    assert told == [(STEP, whole), (2 * STEP, whole), (whole, whole)]


def test_bounds_are_those_of_the_centres(tmp_path: Path) -> None:
    table = rows(2, 0)
    table["x"], table["y"], table["z"] = [1, -2], [3, 4], [0, 5]
    found, _ = read(saved(tmp_path / "a.ply", table))
    assert found.bounds == ((-2, 3, 0), (1, 4, 5))


def test_a_folder_is_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    for name in ("frame_10.ply", "frame_9.ply", "v2_frame_011.splat", "notes.txt"):
        (tmp_path / name).touch()
    names = [path.name for path in sequence(tmp_path)]
    assert names == ["frame_9.ply", "frame_10.ply", "v2_frame_011.splat"]
    (tmp_path / "other_09.ply").touch()
    with pytest.raises(ValueError, match="has the number of frame_9"):
        sequence(tmp_path)


@pytest.mark.parametrize("names", [[], ["scene.ply"]])
def test_a_folder_that_is_no_sequence_is_refused(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        (tmp_path / name).touch()
    with pytest.raises(ValueError, match=r"number|no files"):
        sequence(tmp_path)


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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "camera 1: width is 0"),
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


@pytest.mark.parametrize("text", ["", "{}", "[1]", "[{}]", "[" * 100_000, '[{"a": 1}', "\xff"])
def test_another_file_is_no_cameras(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(text, "latin-1")
    with pytest.raises(ValueError, match=f"^{path}: "):
        read_cameras(path)


def test_a_scene_is_made_the_same_for_the_same_seed(tmp_path: Path) -> None:
    a, b, c = (tmp_path / name for name in ("a.ply", "b.ply", "c.ply"))
    assert main(["1000", str(a)]) == main(["1000", str(b)]) == 0
    assert main(["1000", str(c), "--seed", "2"]) == 0
    assert a.read_bytes() == b.read_bytes() != c.read_bytes()


def test_a_made_scene_has_the_statistics_of_trained_ones() -> None:
    scene = made(20_000)
    flatness = np.sort(scene.scales, axis=1)
    assert np.median(flatness[:, 0] / flatness[:, 1]) < 0.25
    low, high = (scene.opacities < 0.25).mean(), (scene.opacities > 0.75).mean()
    assert low > 0.2
    assert high > 0.5
    np.testing.assert_allclose(np.linalg.norm(scene.rotations, axis=1), 1, atol=1e-6)
    powers = [np.square(scene.coefficients[:, band]).mean() for band in (1, 4, 9)]
    assert powers[0] > powers[1] > powers[2] > 0


def test_flat_gaussians_lie_on_their_surface() -> None:
    scene = made(20_000)
    is_floor = np.abs(scene.means[:, 1] - 1) < 1e-6
    x, y, z, w = scene.rotations[is_floor].T
    thin = np.stack((2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)), axis=1)
    assert len(thin) > 5_000
    np.testing.assert_allclose(thin, np.broadcast_to((0, -1, 0), thin.shape), atol=1e-5)


@pytest.mark.parametrize(
    "arguments", [["0", "a.ply"], ["ten", "a.ply"], ["5", "a.ply", "--degree", "4"]]
)
def test_wrong_usage_ends_with_2(arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)


def test_another_kind_of_file_is_not_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["5", str(tmp_path / "a.obj")]) == 1
    assert "neither .ply nor .splat" in capsys.readouterr().err
