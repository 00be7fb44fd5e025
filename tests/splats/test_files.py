"""What 3DGS and others write is read as they mean it, and what is none of that is told plainly."""

from __future__ import annotations

import json
import math
import re
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import plyfile
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from splatbus_splats.files import container, ply, splat
from splatbus_splats.files.cameras import read_cameras
from splatbus_splats.files.header import TYPES, read_header
from splatbus_splats.files.read import (
    ACTIVATED,
    BRIGHTEST,
    INVISIBLE,
    STEP,
    read,
    sequence,
)
from splatbus_splats.gaussians import Gaussians

from tests.splats.shots import cloud, drawn, view_of
from tests.splats.times import ALL
from tests.splats.times import drawn as in_time

KINDS = [(True, "<"), (False, "<"), (False, ">")]
"""Whether a text, and the order of bytes."""
shared = settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])


def vertices(count: int, rest: int = 0, **values: object) -> np.ndarray:
    names = (*ply.NEEDED, *(f"f_rest_{i}" for i in range(rest)), "nx")
    table = np.zeros(count, [(name, "f4") for name in names])
    table["rot_0"] = 1
    for name, value in values.items():
        table[name] = value
    return table


def saved(path: Path, table: np.ndarray, text: bool = False, order: str = "<") -> Path:
    element = plyfile.PlyElement.describe(table, "vertex")
    with np.errstate(all="ignore"):
        plyfile.PlyData([element], text=text, byte_order=order).write(str(path))
    return path


def refused(path: Path, reading: Callable[[Path], object] = read) -> str:
    """What is said of a file, in one line that begins with its name."""
    with pytest.raises(ValueError, match=f"^{re.escape(str(path))}") as caught:
        reading(path)
    return str(caught.value)


@pytest.mark.parametrize(("text", "order"), KINDS)
def test_a_vertex_means_what_3dgs_means(tmp_path: Path, text: bool, order: str) -> None:
    rest = {f"f_rest_{i}": float(i) for i in range(9)}
    table = vertices(
        1, 9, x=1, y=2, z=3, f_dc_0=0.1, f_dc_1=0.2, f_dc_2=0.3, opacity=math.log(3), scale_0=0,
        scale_1=math.log(2), scale_2=-math.inf, rot_0=2e-20, rot_1=0, rot_2=0, rot_3=-2e-20, **rest,
    )  # fmt: skip
    found, left_out, *_ = read(saved(tmp_path / "a.ply", table, text, order))
    assert not left_out
    np.testing.assert_array_equal(found.means, [[1, 2, 3]])
    np.testing.assert_allclose(found.opacities, [0.75], rtol=1e-6)
    np.testing.assert_allclose(found.scales, [[1, 2, 0]], rtol=1e-6)
    np.testing.assert_allclose(found.rotations, [[0, 0, -(0.5**0.5), 0.5**0.5]], rtol=1e-6)
    np.testing.assert_allclose(found.coefficients[0, 0], [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_array_equal(found.coefficients[0, 1:], [[0, 3, 6], [1, 4, 7], [2, 5, 8]])
    assert all(getattr(found, name).dtype == np.float32 for name in Gaussians.__annotations__)


@pytest.mark.parametrize("degree", range(4))
def test_what_is_written_is_read_again_by_us_and_by_plyfile(tmp_path: Path, degree: int) -> None:
    scene = cloud(STEP + 3 if degree == 0 else 300, degree)
    ply.write(tmp_path / "a.ply", scene)
    found, left_out, *_ = read(tmp_path / "a.ply")
    assert not left_out
    np.testing.assert_array_equal(found.means, scene.means)
    np.testing.assert_array_equal(found.coefficients, scene.coefficients)
    np.testing.assert_allclose(found.scales, scene.scales, rtol=2e-6)
    np.testing.assert_allclose(found.opacities, scene.opacities, atol=1e-6)
    np.testing.assert_allclose(found.rotations, scene.rotations, atol=2e-7)
    data = plyfile.PlyData.read(str(tmp_path / "a.ply"))["vertex"].data
    np.testing.assert_array_equal(data["rot_0"], scene.rotations[:, 3])


def test_a_splat_is_read(tmp_path: Path) -> None:
    record = np.zeros(3, splat.RECORD)
    record["mean"][0], record["scale"][0] = [1, 2, 3], [0.5, 0, 4]
    record["rgba"][0], record["turn"][0] = [255, 0, 51, 255], [128, 128, 255, 128]
    record["scale"][1, 2] = -1
    record["turn"][2] = 128
    record.tofile(tmp_path / "a.splat")
    found, left_out, *_ = read(tmp_path / "a.splat")
    assert left_out == {"scale negative": 1, "quaternion zero": 1}
    np.testing.assert_array_equal(found.means, [[1, 2, 3]])
    np.testing.assert_array_equal(found.scales, [[0.5, 0, 4]])
    np.testing.assert_array_equal(found.opacities, [1])
    np.testing.assert_array_equal(found.rotations, [[0, 1, 0, 0]])
    shown = 0.5 + 0.28209479177387814 * found.coefficients[0, 0]
    np.testing.assert_allclose(shown, [1, 0, 0.2], atol=1e-7)


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
    table = vertices(STEP + 20, 9, x=np.arange(STEP + 20))
    table = table.astype([(name, "f8") for name in table.dtype.names])
    for place, values in enumerate(BAD.values()):
        for name, value in values.items():
            table[name][2 * place + 1] = value
    table["opacity"][STEP + 4 : STEP + 6] = math.inf, -math.inf
    table["rot_0"][STEP + 1] = math.nan
    table["f_dc_1"][STEP + 2] = 1e300  # which single precision cannot hold
    found, left_out, *_ = read(saved(tmp_path / "a.ply", table))
    more = {"quaternion not finite": 2, "harmonics not finite": 2}
    assert left_out == dict.fromkeys(BAD, 1) | more
    bad = {2 * place + 1 for place in range(len(BAD))} | {STEP + 1, STEP + 2}
    assert found.means[:, 0].tolist() == [i for i in range(len(table)) if i not in bad]
    assert found.opacities[-16:-14].tolist() == [1, 0]


def test_the_largest_harmonics_are_drawn_as_numbers(tmp_path: Path) -> None:
    table = vertices(3, 45, z=3)
    for name in table.dtype.names or ():
        if name.startswith("f_"):
            table[name] = [1e35, -1e35, math.nextafter(BRIGHTEST, 0.0)]
    found = read(saved(tmp_path / "a.ply", table)).gaussians
    assert len(found) == 3
    assert np.isfinite(drawn(view_of(), {"default": found}).color).all()


@st.composite
def tables(draw: st.DrawFn) -> np.ndarray:
    text = st.from_regex(r"[a-z_]{1,8}", fullmatch=True)
    names = draw(st.lists(text, min_size=1, max_size=9, unique=True))
    dtype = np.dtype([(name, draw(st.sampled_from(sorted(TYPES)))) for name in names])
    count, seed = draw(st.integers(0, 40)), draw(st.integers(0, 2**32 - 1))
    table = np.frombuffer(np.random.default_rng(seed).bytes(count * dtype.itemsize), dtype).copy()
    for name in names:  # one NaN is as good as another, and a text keeps no payload
        if table[name].dtype.kind == "f":
            table[name][np.isnan(table[name])] = np.nan
    return table


def ours(path: Path) -> np.ndarray:
    """The vertices, seven at a time."""
    with path.open("rb") as file:
        header = read_header(file, path)
        element = next(each for each in header.elements if each.name == "vertex")
        place = container.found(file, path, header, element)
        parts = container.pieces(file, path, header, element, place, 7)
        dtype = [(each.name, header.order + each.number) for each in element.properties]
        return np.concatenate([np.empty(0, dtype), *(part.copy() for part in parts)])


def others(name: str, lengths: list[int]) -> plyfile.PlyElement:
    """Of lists and other numbers."""
    rows = np.empty(len(lengths), [("a", "i2"), ("many", object), ("b", "f8")])
    for row, length in enumerate(lengths):
        rows[row] = (row, np.arange(length, dtype="i4"), 0.5)
    types = {"val_types": {"many": "i4"}, "len_types": {"many": "u1"}}
    return plyfile.PlyElement.describe(rows, name, **types)


@shared
@given(
    table=tables(),
    kind=st.sampled_from(KINDS),
    lengths=st.lists(st.integers(0, 5), max_size=5),
    comments=st.lists(st.sampled_from(["", "element x 1", "ein Wort"]), max_size=2),
)
def test_what_plyfile_writes_is_read_alike(
    table: np.ndarray, kind: tuple[bool, str], lengths: list[int], comments: list[str],
    tmp_path: Path,
) -> None:  # fmt: skip
    path, before = tmp_path / "a.ply", [plyfile.PlyElement.describe(np.ones(3, "u2,f4"), "edge")]
    if kind[0]:
        before.append(others("face", lengths))
    vertex = plyfile.PlyElement.describe(table, "vertex", comments=comments)
    with np.errstate(all="ignore"):
        plyfile.PlyData(
            [*before, vertex, others("last", lengths)], *kind, comments=comments, obj_info=comments
        ).write(str(path))
    found = ours(path)
    assert found.dtype.newbyteorder("<") == table.dtype
    for name in table.dtype.names or ():
        np.testing.assert_array_equal(found[name], table[name])


@pytest.mark.parametrize("text", [False, True])
def test_lines_may_end_in_a_carriage_return(tmp_path: Path, text: bool) -> None:
    table = vertices(3, x=13, y=10)
    header, data = saved(tmp_path / "a.ply", table, text).read_bytes().split(b"end_header\n")
    data = data.replace(b"\n", b"\r\n") if text else data
    path = tmp_path / "b.ply"
    path.write_bytes(header.replace(b"\n", b"\r\n") + b"end_header\r\n" + data)
    np.testing.assert_array_equal(ours(path), table)


HEADER = (
    b"ply\nformat ascii 1.0\ncomment of one\nelement vertex 1\nproperty float x\nend_header\n1\n"
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"ply\n", b"plx\n", "no PLY file: its first line is not 'ply'"),
        (b"ascii", b"asci", "line 2: format 'asci 1.0', where there are ascii, binary_little"),
        (b"1.0", b"2.0", "line 2: format"),
        (b"comment of", b"format ascii", "line 3: a second format"),
        (b"format ascii 1.0", b"comment", "line 6: the header ends without a format"),
        (b"vertex 1", b"vertex 1.5", "line 4: an element has a name and a count of rows"),
        (b"vertex 1", b"vertex", "line 4: an element has a name and a count of rows"),
        (b"comment of one", b"element vertex 0", "line 4: a second element vertex"),
        (b"comment of one", b"property float x", "line 3: a property before the first element"),
        (b"comment of one", b"commend of one", "line 3: 'commend of one' is no line of a header"),
        (b"comment of one", b"", "line 3: '' is no line of a header"),
        (b"float x", b"half x", "line 5: 'half' is no type of a number"),
        (b"float x", b"float x\nproperty int x", "line 6: a second property x of vertex"),
        (b"float x", b"float", "line 5: a property has a type and a name, a list two types"),
        (b"float x", b"list char x", "line 5: a property has a type and a name, a list two types"),
        (b"float x", b"list float int x", "line 5: the length of a list is a whole number"),
        (b"end_header\n1\n", b"end_header", "line 6: the file ends at byte 80, in its header"),
        (b"end_header\n1\n", b"", "line 6: the file ends at byte 70, in its header"),
        (b"of one", b"x" * 70_000, "line 3: too long for a header"),
        (b"comment of one\n", b"comment\n" * 140_000, "too long for a header"),
        (b"element", b"element face 2\nproperty list uchar int at\nelement", "the file ends at"),
        (b"\n1\n", b"\n1 2\n", "line 7: '1 2' is no row of the 1 numbers that the header says"),
        (b"float x\nend_header\n1\n", b"uchar x\nproperty int y\nend_header\n256 1\n",
         "line 8: '256 1' is no row of the 2 numbers"),
        (b"r\n1\n", b"r\nx\n", "line 7: 'x' is no row"),
        (b"r\n1\n", b"r\n\n\n", "line 7: '' is no row"),
        (b"1\nproperty float x\nend_header\n", b"3\nproperty char x\nend_header\n1\n1.5\n",
         "line 8: '1.5' is no row"),
        (b"vertex 1", b"vertex 2", "the file ends at byte 83, before the last of 2 rows of vertex"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(
    tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(HEADER)
    assert ours(path)["x"].tolist() == [1.0]
    path.write_bytes(HEADER.replace(old, new, 1))
    assert message in refused(path, ours)


def test_rows_behind_binary_lists_are_not_looked_for(tmp_path: Path) -> None:
    before, vertex = others("face", [3]), plyfile.PlyElement.describe(vertices(2), "vertex")
    plyfile.PlyData([before, vertex]).write(str(tmp_path / "a.ply"))
    assert "lists of face lie before the vertex rows" in refused(tmp_path / "a.ply")


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("before", ["", "element face {}\nproperty int at\n"])
def test_what_a_header_claims_takes_no_memory_and_no_time(
    tmp_path: Path, kind: str, before: str
) -> None:
    names = "".join(f"property float {name}\n" for name in ply.NEEDED)
    for count in (10**9, 10**18, 10**25):
        claim = f"ply\nformat {kind} 1.0\n{before.format(count)}element vertex {count}\n"
        path = tmp_path / "a.ply"
        path.write_bytes(f"{claim}{names}end_header\n".encode() + bytes(1000))
        assert re.search(r"ends at byte .* before the last of \d+(,000)+ ", refused(path))


def test_reading_takes_memory_for_one_copy_and_tells_how_far_it_is(tmp_path: Path) -> None:
    count = 200_000
    ply.write(tmp_path / "a.ply", cloud(count))
    told: list[tuple[int, int]] = []
    tracemalloc.start()
    try:
        read(tmp_path / "a.ply", lambda *done: told.append(done))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1.3 * (tmp_path / "a.ply").stat().st_size
    assert told == [(min(i + STEP, count), count) for i in range(0, count, STEP)]


POINTS = np.zeros(3, [(name, "f4") for name in "xyz"])


def without(name: str) -> np.ndarray:
    return np.zeros(3, [each for each in vertices(0).dtype.descr if each[0] != name])


def wide(*more: str, gone: tuple[str, ...] = ()) -> np.ndarray:
    """Gaussians in time."""
    return np.ones(2, [(name, "<f4") for name in (*ALL, *more) if name not in gone])


def renamed(table: np.ndarray, old: str, new: str) -> np.ndarray:
    table.dtype.names = tuple(name.replace(old, new) for name in table.dtype.names or ())
    return table


REST = " properties f_rest_*, where there are 0, 9, 24, 45"


@pytest.mark.parametrize(
    ("name", "holds", "message"),
    [
        ("a.ply", b"", "the file is empty"),
        ("a.splat", b"", "the file is empty"),
        ("a.ply", b"Dear diary", "no PLY file: its first line"),
        ("a.txt", b"Dear diary", "ends in none of .ply .splat .spz .sog .ksplat .glb .gltf"),
        ("a.ksplat", bytes(64), "this .ksplat file cannot be read: "),
        ("a.SPZ", bytes(64), "this .spz file cannot be read: it is cut short"),
        ("a.spz", b"<html>", "it is a page of the web"),
        ("a.splat", bytes(70), "the Gaussian at byte 64 is cut short"),
        ("a.splat", b"ply\n" + bytes(60), "it is a .ply"),
        ("a.splat", b"\x89PNG" + bytes(60), "it is a PNG"),
        ("a.splat", b"PK\x03\x04" + bytes(60), "it is an archive"),
        ("a.ply", b"version https://git-lfs.github.com/spec/v1\noid", "git lfs pull"),
        ("a.splat", b"\n<!DOCTYPE html>", "it is a page of the web"),
        ("a.ply", b"\x1f\x8b\x08" + bytes(9), "packed by gzip: name it .spz if it is one"),
        ("a.ply", bytes(257) + b"ustar", "it is an archive (tar)"),
        ("a.ply", b"glTF" + bytes(60), "it is a glTF: name it .glb"),
        ("a.ply", POINTS, "no property f_dc_0, "),
        ("a.ply", POINTS, "it is a mesh or a cloud of points"),
        ("a.ply", np.zeros(3, [("packed_position", "u4")]), "this compressed .ply file cannot be "),
        ("a.ply", without("scale_2"), "flat ones (2DGS), which are not drawn"),
        ("a.ply", without("opacity"), "it is no plain file of 3DGS"),
        ("a.ply", without("f_dc_0"), "it is a mesh or a cloud of points"),
        ("a.ply", renamed(vertices(3), "nx", "filter_3D"), "filter_3D, without which"),
        ("a.ply", vertices(2, 1), f"1{REST}"),
        ("a.ply", vertices(2, 44), f"44{REST}"),
        ("a.ply", vertices(2, 72), f"72{REST}"),
        ("a.ply", renamed(vertices(2, 9), "f_rest_4", "f_rest_9"), "but no f_rest_4"),
        ("a.ply", wide(gone=("trbf_scale",)), "no property trbf_scale"),
        ("a.ply", wide(gone=("motion_8",)), "no property motion_8"),
        ("a.ply", wide(gone=("motion_1",)), "no property motion_1"),
        ("a.ply", wide(gone=("omega_2",)), "no property omega_2"),
        ("a.ply", wide("motion_9", "motion_10", "motion_11"), "12 properties motion_*, where"),
        ("a.ply", wide("f_dc_3"), "a network that is not in the file"),
    ],
)
def test_a_file_that_is_none_is_told_what_it_may_be(
    tmp_path: Path, name: str, holds: bytes | np.ndarray, message: str
) -> None:
    path = tmp_path / name
    if isinstance(holds, bytes):
        path.write_bytes(holds)
    else:
        saved(path, holds)
    assert message in refused(path)


def test_only_numbers_of_vertices_are_gaussians(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.ply", vertices(2), True)
    text = path.read_text()
    path.write_text(text.replace("element vertex", "element point"))
    assert "no element vertex" in refused(path)
    path.write_text(text.replace("float opacity", "list uchar float opacity"))
    assert "the property opacity is a list, and not a number" in refused(path)


def test_names_are_read_as_cloudcompare_writes_them(tmp_path: Path) -> None:
    table = vertices(3, x=[1, 2, 3], opacity=-1)
    table.dtype.names = tuple(n if n in "xyz" else f"scalar_{n}" for n in table.dtype.names or ())
    assert read(saved(tmp_path / "a.ply", table)).gaussians.means[:, 0].tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("values", "doubts"),
    [
        ({"opacity": [-1, 1], "scale_0": -2}, ()),
        ({each: [0.5, 0.01] for each in ("opacity", *ply.SCALE)}, (ACTIVATED,)),
        ({"opacity": [-6, -100]}, (INVISIBLE,)),
    ],
)
def test_what_looks_wrong_as_a_whole_is_doubted(
    tmp_path: Path, values: dict[str, object], doubts: tuple[str, ...]
) -> None:
    assert read(saved(tmp_path / "a.ply", vertices(2, **values))).doubts == doubts


@pytest.mark.parametrize(("name", "step"), [("a.ply", 1 / 8192), ("a.splat", 1)])
def test_coordinates_of_maps_are_counted_from_the_middle_before_they_are_rounded(
    tmp_path: Path, name: str, step: float
) -> None:
    """Doubles keep what float32 could not; what is float32 already is whole."""
    steps, path = step * np.arange(-2, 3), tmp_path / name
    places = np.stack([5e5 + steps, 0 * steps, 4e6 - steps], axis=1)
    if name == "a.splat":
        rows = np.zeros(5, splat.RECORD)
        rows["mean"], rows["turn"] = places, 255
        rows.tofile(path)
    else:
        table = np.zeros(5, [(each, "f8" if each in "xyz" else "f4") for each in ply.NEEDED])
        table["x"], table["y"], table["z"] = places.T
        table["rot_0"] = 1
        saved(path, table)
    found = read(path, origin=None)
    assert found.origin.tolist() == [5e5, 0, 4e6]
    assert (found.gaussians.means == np.stack([steps, 0 * steps, -steps], axis=1)).all()


def test_coordinates_that_are_near_are_counted_from_0(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.ply", vertices(5, x=9999))
    assert not read(path, origin=None).origin.any()


@pytest.mark.parametrize(("comment", "up"), [("Vertical Axis: z", "z"), ("made by hand", "")])
def test_a_comment_says_what_is_upwards(tmp_path: Path, comment: str, up: str) -> None:
    path = saved(tmp_path / "a.ply", vertices(1))
    path.write_bytes(
        path.read_bytes().replace(b"element", f"comment {comment}\nelement".encode(), 1)
    )
    assert read(path).up == up


def test_no_vertices_are_an_empty_scene(tmp_path: Path) -> None:
    found, left_out, *_ = read(saved(tmp_path / "a.ply", vertices(0, 9)))
    assert (len(found), found.degree, found.bounds, left_out) == (0, 1, None, {})


@shared
@given(
    changes=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6),
    kind=st.sampled_from([*KINDS, None]),
    cut=st.floats(0.5, 1),
)
def test_what_is_changed_is_read_or_refused_and_nothing_else(
    changes: list[tuple[float, int]], kind: tuple[bool, str] | None, cut: float, tmp_path: Path
) -> None:
    table = vertices(3, 9) if kind else in_time(3)
    bytes_of = bytearray(saved(tmp_path / "a.ply", table, *(kind or ())).read_bytes())
    for place, byte in changes:
        bytes_of[int(place * (len(bytes_of) - 1))] = byte
    path = tmp_path / "b.ply"
    path.write_bytes(bytes_of[: int(cut * len(bytes_of))] if cut < 0.75 else bytes_of)
    try:
        found = read(path)
    except ValueError as error:
        assert str(error).startswith(f"{path}: ")  # noqa: PT017
    else:
        assert len(found.gaussians) + sum(found.left_out.values()) < 100
        assert np.isfinite(found.gaussians.means).all()


def test_a_folder_is_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no file of .ply .splat .spz .* .gltf is in it"):
        sequence(tmp_path)
    (tmp_path / "scene.ply").touch()
    (tmp_path / "._scene.ply").touch()  # as macOS leaves beside what it copies
    (tmp_path / "mesh3.ply").mkdir()
    assert sequence(tmp_path) == [tmp_path / "scene.ply"]
    (tmp_path / "frame_10.ply").touch()
    with pytest.raises(ValueError, match=r"scene.ply: no number"):
        sequence(tmp_path)
    (tmp_path / "scene.ply").rename(tmp_path / "frame_9.ply")
    (tmp_path / "v2_frame_011.splat").touch()
    names = [path.name for path in sequence(tmp_path)]
    assert names == ["frame_9.ply", "frame_10.ply", "v2_frame_011.splat"]
    (tmp_path / "other_09.ply").touch()
    with pytest.raises(ValueError, match="has the number of frame_9"):
        sequence(tmp_path)


CAMERA = {
    "id": 0, "img_name": "00001", "width": 640, "height": 480.0, "position": [1, 2, 3],
    "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]], "fx": 500.5, "fy": 501,
}  # fmt: skip


def test_cameras_are_read(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps([CAMERA, {k: v for k, v in CAMERA.items() if k != "img_name"}]))
    first, second = read_cameras(path, 0.2, 50)
    assert (first.name, second.name) == ("00001", "its picture")
    assert first.pose == ((1, 2, 3), (0.5, 0.5, 0.5, 0.5))  # the camera's z is the world's x
    assert first.lens == (500.5, 501, 320, 240, 640, 480, 0.2, 50)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "camera 1: width is 0"),
        ({"width": 640.5}, "camera 1: width is 640.5"),
        ({"fx": -1}, "camera 1: fx is -1"),
        ({"fy": "1"}, "camera 1: fy is a string"),
        ({"position": [1, 2]}, "camera 1: position has 2 items"),
        ({"position": [1, 2, 10**400]}, "camera 1: position.2 is .*, not a finite number"),
        ({"rotation": [[1, 0, 0], [0, 1, 0]]}, "camera 1: rotation has 2 items"),
        ({"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "camera 1: rotation .* reflection"),
        ({"rotation": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "camera 1: rotation .* not orthogonal"),
        ("", "no cameras.json of 3DGS"),
        ("{}", "no list of cameras"),
        ("[]", "no list of cameras"),
        ("[1]", "camera 0: the message is a number"),
        ("[{}]", "camera 0: width is missing"),
        ("[" * 100_000, "no list of cameras: it is nested too deeply"),
        ("\xff", "no cameras.json of 3DGS"),
    ],
)
def test_cameras_that_are_none_are_refused(tmp_path: Path, change: object, message: str) -> None:
    path = tmp_path / "cameras.json"
    cameras = change if isinstance(change, str) else json.dumps([CAMERA, {**CAMERA, **change}])  # type: ignore[dict-item]
    path.write_text(cameras, "latin-1")
    assert re.search(message, refused(path, read_cameras))
