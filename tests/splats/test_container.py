"""PLY files are read as plyfile reads them, of whatever types and order; bad ones are told."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import plyfile
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from splatbus_splats.files import container
from splatbus_splats.files.header import CODES, TYPES, read_header
from splatbus_splats.files.read import read
from splatbus_splats.made import made

from tests.splats.test_read import rows, saved

NAMES = st.lists(st.from_regex(r"[a-z_]{1,8}", fullmatch=True), min_size=1, max_size=9, unique=True)
ORDERS = st.sampled_from("<>")
shared = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def tables(draw: st.DrawFn, order: str) -> np.ndarray:
    names = draw(NAMES)
    codes = [draw(st.sampled_from(sorted(TYPES))) for _ in names]
    count = draw(st.integers(0, 40))
    dtype = np.dtype([(name, order + code) for name, code in zip(names, codes, strict=True)])
    seed = draw(st.integers(0, 2**32 - 1))
    table = np.frombuffer(np.random.default_rng(seed).bytes(count * dtype.itemsize), dtype).copy()
    for name in names:  # one NaN is as good as another, and a text keeps no payload
        if table[name].dtype.kind == "f":
            table[name][np.isnan(table[name])] = np.nan
    return table


def ours(path: Path, name: str, step: int = 7) -> np.ndarray:
    with path.open("rb") as file:
        header = read_header(file, path)
        element = next(each for each in header.elements if each.name == name)
        place = container.found(file, path, header, element)
        parts = container.pieces(file, path, header, element, place, step)
        copies = [part.copy() for part in parts]
    dtype = [(each.name, header.order + each.number) for each in element.properties]
    return np.concatenate([np.empty(0, dtype), *copies])


def same(a: np.ndarray, b: np.ndarray) -> None:
    assert a.dtype.names == b.dtype.names
    assert len(a) == len(b)
    for name in a.dtype.names or ():
        assert a[name].dtype.str[1:] == b[name].dtype.str[1:]
        np.testing.assert_array_equal(a[name], b[name])


@shared
@given(data=st.data(), order=ORDERS, text=st.booleans())
def test_what_plyfile_writes_is_read_alike(
    data: st.DataObject, order: str, text: bool, tmp_path: Path
) -> None:
    table = data.draw(tables(order))
    path = tmp_path / "a.ply"
    comments = data.draw(st.lists(st.sampled_from(["", "element x 1", "ein Wort"]), max_size=2))
    element = plyfile.PlyElement.describe(table, "vertex", comments=comments)
    with np.errstate(all="ignore"):
        plyfile.PlyData(
            [element], text=text, byte_order=order, comments=comments, obj_info=comments
        ).write(str(path))
    same(ours(path, "vertex"), table)


@shared
@given(data=st.data(), order=ORDERS)
def test_what_is_written_plyfile_reads_alike(
    data: st.DataObject, order: str, tmp_path: Path
) -> None:
    table = data.draw(tables(order))
    container.write(tmp_path / "a.ply", table)
    read_there = plyfile.PlyData.read(str(tmp_path / "a.ply"))
    assert [each.name for each in read_there.elements] == ["vertex"]
    same(np.asarray(read_there["vertex"].data), table)
    same(ours(tmp_path / "a.ply", "vertex"), table)


@shared
@given(data=st.data(), order=ORDERS, text=st.booleans())
def test_elements_before_are_passed_over_with_their_lists(
    data: st.DataObject, order: str, text: bool, tmp_path: Path
) -> None:
    table = data.draw(tables(order))
    lengths = data.draw(st.lists(st.integers(0, 5), max_size=5))
    lists = np.empty(len(lengths), [("a", "i2"), ("many", object), ("b", "f8")])
    for row, length in enumerate(lengths):
        lists[row] = (row, np.arange(length, dtype="i4"), 0.5)
    before = plyfile.PlyElement.describe(
        lists, "face", val_types={"many": "i4"}, len_types={"many": "u1"}
    )
    plain = plyfile.PlyElement.describe(np.ones(3, [("c", "u2"), ("d", "f4")]), "edge")
    element = plyfile.PlyElement.describe(table, "vertex")
    path = tmp_path / "a.ply"
    plyfile.PlyData([before, plain, element, before_again(before)], text, order).write(str(path))
    same(ours(path, "vertex"), table)


def before_again(element: Any) -> Any:
    return plyfile.PlyElement.describe(
        element.data, "last", val_types={"many": "i4"}, len_types={"many": "u1"}
    )


@pytest.mark.parametrize("text", [False, True])
def test_lines_may_end_in_a_carriage_return(tmp_path: Path, text: bool) -> None:
    table = rows(3, 0, x=13, y=10)
    whole = saved(tmp_path / "a.ply", table, text).read_bytes()
    header, data = whole.split(b"end_header\n")
    data = data.replace(b"\n", b"\r\n") if text else data
    path = tmp_path / "b.ply"
    path.write_bytes(header.replace(b"\n", b"\r\n") + b"end_header\r\n" + data)
    same(ours(path, "vertex"), table)


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
        (b"vertex 1", b"vertex -1", "line 4: an element has a name and a count of rows"),
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
    ],
)
def test_a_bad_header_is_told_with_its_line(
    tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    path = tmp_path / "a.ply"
    assert read_header(io.BytesIO(HEADER), path).lines == 6
    with pytest.raises(ValueError, match=f"^{path}: ") as caught:
        read_header(io.BytesIO(HEADER.replace(old, new, 1)), path)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"1 2\n3 4 5\n", "line 8: 3 numbers, where 2 belong"),
        (b"1 2\n3 x4\n", "line 8: 'x4' is no number"),
        (b"1 2\n3.5 4\n", "line 8: n is no uint8"),
        (b"1 2\n256 4\n", "line 8: n is no uint8"),
        (b"nan 2\n25 4\n", "line 7: n is no uint8"),
        (b"1 2\n", "the file ends at byte 87, before the last of 2 rows of vertex"),
        (b"1 2222222222\n", "the file ends at byte 96, before the last of 2 rows of vertex"),
    ],
)
def test_a_text_that_is_none_is_told_with_its_line(
    tmp_path: Path, text: bytes, message: str
) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(
        b"ply\nformat ascii 1.0\nelement vertex 2\nproperty uchar n\nproperty float x\nend_header\n"
        + text
    )
    with pytest.raises(ValueError, match=f"^{path}: ") as caught:
        ours(path, "vertex")
    assert message in str(caught.value)


def test_lines_are_counted_behind_other_elements(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(
        b"ply\nformat ascii 1.0\nelement face 3\nproperty list uchar int at\n"
        b"element vertex 2\nproperty float x\nend_header\n0\n0\n1 5\n4\nfour\n"
    )
    with pytest.raises(ValueError, match=r"a\.ply: line 12: 'four' is no number"):
        ours(path, "vertex")


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("before", ["", "element face {}\nproperty list uchar int at\n"])
def test_what_a_header_claims_takes_no_memory_and_no_time(
    tmp_path: Path, kind: str, before: str
) -> None:
    names = "".join(f"property float {name}\n" for name in rows(0, 0).dtype.names or ())
    for count in (10**9, 10**18, 10**25):
        claim = f"ply\nformat {kind} 1.0\n{before.format(count)}element vertex {count}\n"
        path = tmp_path / "a.ply"
        path.write_bytes(f"{claim}{names}end_header\n".encode() + bytes(1000))
        with pytest.raises(ValueError, match=r"ends at byte .* before the last of \d+(,000)+ "):
            read(path)


def test_a_list_of_less_than_nothing_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement face 2\nproperty list char int at\n"
        b"element vertex 1\nproperty char x\nend_header\n\x00\xff\x01\x01\x01"
    )
    with pytest.raises(ValueError, match="at of row 1 of face has -1 items"):
        ours(path, "vertex")


def test_all_types_have_both_their_names() -> None:
    assert len(CODES) == 16
    assert all(np.dtype(code).name == new for code, (_, new) in TYPES.items())


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    changes=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6),
    kind=st.sampled_from(["ascii", "<", ">", "time"]),
    cut=st.floats(0.5, 1),
)
def test_what_is_changed_is_read_or_refused_and_nothing_else(
    changes: list[tuple[float, int]], kind: str, cut: float, tmp_path: Path
) -> None:
    table = rows(3, 9 if kind != "time" else 0)
    if kind == "time":
        names = [
            *table.dtype.names,
            "trbf_center",
            "trbf_scale",
            *(f"motion_{i}" for i in range(9)),
        ]
        wide = np.ones(3, [(name, "f4") for name in names])
        saved(tmp_path / "a.ply", wide)
    else:
        saved(tmp_path / "a.ply", table, kind == "ascii", kind if kind in "<>" else "<")
    bytes_of = bytearray((tmp_path / "a.ply").read_bytes())
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


def test_a_made_scene_is_written_as_plyfile_reads_it(tmp_path: Path) -> None:
    from splatbus_splats.files import ply

    scene = made(100, 1)
    ply.write(tmp_path / "a.ply", scene)
    data = plyfile.PlyData.read(str(tmp_path / "a.ply"))["vertex"].data
    np.testing.assert_array_equal(data["x"], scene.means[:, 0])
    np.testing.assert_array_equal(data["rot_0"], scene.rotations[:, 3])
