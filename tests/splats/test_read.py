"""What 3DGS and others write is read as they mean it, and what is no splat file is told plainly."""

from __future__ import annotations

import math
import tracemalloc
from pathlib import Path

import numpy as np
import plyfile
import pytest
from splatbus_splats.drawing.definition import placed
from splatbus_splats.drawing.renderer import rendered
from splatbus_splats.files import ply, splat
from splatbus_splats.files.read import BRIGHTEST, STEP, read, sequence
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.made import made

from tests.splats.shots import view_of

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
    found, left_out, _ = read(saved(tmp_path / "a.ply", table, text, order))
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
    found, left_out, _ = read(tmp_path / "a.ply")
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
    found, left_out, _ = read(tmp_path / "a.splat")
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
    found = read(tmp_path / "a.splat").gaussians
    np.testing.assert_array_equal(found.scales, scene.scales)
    np.testing.assert_allclose(found.opacities, scene.opacities, atol=0.5 / 255 + 1e-6)
    same = np.abs((found.rotations * scene.rotations).sum(axis=1))
    assert same.min() > 0.999


BAD = {
    "position not finite": {"y": math.nan},
    "scale not finite": {"scale_1": 1000.0},
    "opacity not a number": {"opacity": math.nan},
    "harmonics not finite": {"f_rest_3": -math.inf},
    "harmonics too large": {"f_rest_3": -3e38},
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
    found, left_out, _ = read(saved(tmp_path / "a.ply", table))
    assert left_out == dict.fromkeys(BAD, 1) | {"quaternion not finite": 3}
    bad = {2 * place + 1 for place in range(len(BAD))} | {STEP + 1, STEP + 2}
    assert found.means[:, 0].tolist() == [i for i in range(len(table)) if i not in bad]
    assert found.opacities[found.means[:, 0] == STEP + 4].tolist() == [1]
    assert found.opacities[found.means[:, 0] == STEP + 5].tolist() == [0]


def test_what_single_precision_cannot_hold_is_left_out(tmp_path: Path) -> None:
    table = rows(4, 9).astype([(name, "f8") for name in rows(0, 9).dtype.names])
    for i, name in enumerate(("x", "f_rest_2", "f_dc_1")):
        table[name][i] = 1e300
    found, left_out, _ = read(saved(tmp_path / "a.ply", table))
    assert len(found) == 1
    assert left_out == {"position not finite": 1, "harmonics not finite": 2}


def test_a_negative_scale_of_a_splat_is_left_out(tmp_path: Path) -> None:
    record = np.zeros(3, splat.RECORD)
    record["scale"][1, 2] = -1
    record["turn"][2] = 128
    record.tofile(tmp_path / "a.splat")
    found, left_out, _ = read(tmp_path / "a.splat")
    assert len(found) == 1
    assert left_out == {"scale negative": 1, "quaternion zero": 1}


def test_the_largest_harmonics_are_drawn_as_numbers(tmp_path: Path) -> None:
    table = rows(3, 45)
    for name in table.dtype.names or ():
        if name.startswith("f_"):
            table[name] = [1e35, -1e35, math.nextafter(BRIGHTEST, 0.0)]
    table["z"] = 3.0
    found = read(saved(tmp_path / "a.ply", table)).gaussians
    assert len(found) == 3
    view = view_of()
    drawn = rendered(placed(view, {"default": found}), view.intrinsics, view.width, view.height)
    assert np.isfinite(drawn.color).all()


@pytest.mark.parametrize("factor", [1e-30, 1e-3, 1e30])
def test_a_quaternion_of_any_norm_is_a_rotation(tmp_path: Path, factor: float) -> None:
    table = rows(1, 0, rot_0=3 * factor, rot_1=4 * factor)
    found = read(saved(tmp_path / "a.ply", table)).gaussians
    np.testing.assert_allclose(found.rotations, [[0.8, 0, 0, 0.6]], rtol=1e-6)


def test_a_mesh_is_no_splat_file(tmp_path: Path) -> None:
    points = np.zeros(3, [(name, "f4") for name in "xyz"])
    message = refusal(saved(tmp_path / "mesh.ply", points))
    assert message.startswith("no splat file: its vertices have no property f_dc_0")


def test_a_compressed_file_is_said_to_be_one(tmp_path: Path) -> None:
    points = np.zeros(3, [("packed_position", "u4")])
    assert "compressed" in refusal(saved(tmp_path / "a.ply", points))


@pytest.mark.parametrize(
    ("lacks", "hint"),
    [
        ("scale_2", "flat ones (2DGS), which are not drawn"),
        ("opacity", "it is no plain file of 3DGS"),
        ("f_dc_0", "it is a mesh or a cloud of points"),
    ],
)
def test_what_a_file_lacks_says_what_it_may_be(tmp_path: Path, lacks: str, hint: str) -> None:
    whole = rows(3, 0)
    table = np.zeros(3, [each for each in whole.dtype.descr if each[0] != lacks])
    assert hint in refusal(saved(tmp_path / "a.ply", table))


def test_gaussians_whose_filter_is_beside_them_are_refused(tmp_path: Path) -> None:
    table = rows(3, 0)
    filtered = np.zeros(3, [*table.dtype.descr, ("filter_3D", "f4")])
    assert "filter_3D" in refusal(saved(tmp_path / "a.ply", filtered))


@pytest.mark.parametrize(
    ("begins", "what"), [(b"ply\n", "a .ply"), (b"\x89PNG", "a PNG"), (b"PK\x03\x04", "an archive")]
)
def test_a_file_of_others_is_no_splat(tmp_path: Path, begins: bytes, what: str) -> None:
    (tmp_path / "a.splat").write_bytes(begins + bytes(60))
    assert what in refusal(tmp_path / "a.splat")


def test_a_mesh_with_faces_is_no_splat_file(tmp_path: Path) -> None:
    points = np.zeros(3, [(name, "f4") for name in "xyz"])
    faces = np.array([([0, 1, 2],)], [("vertex_indices", "i4", (3,))])
    elements = [plyfile.PlyElement.describe(points, "vertex")]
    elements.append(plyfile.PlyElement.describe(faces, "face"))
    plyfile.PlyData(elements).write(str(tmp_path / "mesh.ply"))
    assert "no property f_dc_0" in refusal(tmp_path / "mesh.ply")


def test_only_vertices_are_gaussians(tmp_path: Path) -> None:
    element = plyfile.PlyElement.describe(rows(2, 0), "point")
    plyfile.PlyData([element]).write(str(tmp_path / "a.ply"))
    assert "no element vertex" in refusal(tmp_path / "a.ply")


@pytest.mark.parametrize("text", [False, True])
def test_what_is_damaged_is_read_or_refused_and_nothing_else(tmp_path: Path, text: bool) -> None:
    whole = saved(tmp_path / "whole.ply", rows(3, 9), text).read_bytes()
    random = np.random.default_rng(3)
    path, refused = tmp_path / "a.ply", 0
    for _ in range(300):
        bytes_of = bytearray(whole)
        for place in random.integers(0, len(whole), random.integers(1, 4)):
            bytes_of[place] = random.choice([random.integers(256), *b" -0123456789\n"])
        path.write_bytes(bytes_of)
        try:
            found, left_out, _ = read(path)
        except ValueError as error:
            assert str(error).startswith(f"{path}: ")  # noqa: PT017
            refused += 1
        else:
            assert len(found) + sum(left_out.values()) < 100
            assert np.isfinite(found.means).all()
    assert 100 < refused < 300


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


def test_a_list_behind_the_vertices_of_3dgs_is_not_read(tmp_path: Path) -> None:
    element = plyfile.PlyElement.describe(rows(2, 0, x=4), "vertex")
    faces = np.array([([0, 1, 2],)], [("vertex_indices", "i4", (3,))])
    behind = plyfile.PlyElement.describe(faces, "face")
    plyfile.PlyData([element, behind]).write(str(tmp_path / "a.ply"))
    assert read(tmp_path / "a.ply").gaussians.means[:, 0].tolist() == [4, 4]


@pytest.mark.parametrize("text", [False, True])
def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path: Path, text: bool) -> None:
    whole = saved(tmp_path / "whole.ply", rows(4, 0), text).read_bytes()
    path = tmp_path / "a.ply"
    places = {0, 1, 3, 10, 100, whole.index(b"end_header"), len(whole) // 2, len(whole) - 3}
    for place in sorted(places):
        path.write_bytes(whole[:place])
        assert refusal(path)
    path.write_bytes(whole[:-68])
    message = f"the file ends at byte {len(whole) - 68}, before the last of 4 rows of vertex"
    assert text or refusal(path).startswith(message)


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
    found, left_out, _ = read(saved(tmp_path / "a.ply", rows(0, 9)))
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


@pytest.mark.parametrize("name", ["a.spz", "a.ksplat", "a.sog", "a.SPZ"])
def test_a_format_of_others_is_told_what_to_do(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(bytes(64))
    assert refusal(tmp_path / name).endswith("is not read: export the scene as a plain .ply first")


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
    assert peak < 1.3 * size


def test_progress_is_told_to_the_end(tmp_path: Path) -> None:
    splat.write(tmp_path / "a.splat", made(2 * STEP + 1, 0))
    told: list[tuple[int, int]] = []
    read(tmp_path / "a.splat", lambda *done: told.append(done))
    whole = 2 * STEP + 1
    assert told == [(STEP, whole), (2 * STEP, whole), (whole, whole)]


def test_bounds_are_those_of_the_centres(tmp_path: Path) -> None:
    table = rows(2, 0)
    table["x"], table["y"], table["z"] = [1, -2], [3, 4], [0, 5]
    found = read(saved(tmp_path / "a.ply", table)).gaussians
    assert found.bounds == ((-2, 3, 0), (1, 4, 5))


def test_a_folder_is_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    for name in ("frame_10.ply", "frame_9.ply", "v2_frame_011.splat", "notes.txt"):
        (tmp_path / name).touch()
    names = [path.name for path in sequence(tmp_path)]
    assert names == ["frame_9.ply", "frame_10.ply", "v2_frame_011.splat"]
    (tmp_path / "other_09.ply").touch()
    with pytest.raises(ValueError, match="has the number of frame_9"):
        sequence(tmp_path)


def test_a_folder_of_one_file_is_that_file(tmp_path: Path) -> None:
    (tmp_path / "scene.ply").touch()
    (tmp_path / "._scene.ply").touch()  # as macOS leaves beside what it copies
    (tmp_path / "mesh3.ply").mkdir()
    assert sequence(tmp_path) == [tmp_path / "scene.ply"]


@pytest.mark.parametrize("names", [[], ["1.ply", "scene.ply"]])
def test_a_folder_that_is_no_sequence_is_refused(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        (tmp_path / name).touch()
    with pytest.raises(ValueError, match=r"number|no files"):
        sequence(tmp_path)
