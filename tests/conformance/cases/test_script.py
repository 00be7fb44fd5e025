"""Scripts are written and read again without loss, and what is none is refused in words."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.script import Case, Script, ScriptError, flat, load, rows, save

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)
CASES = st.builds(Case, st.just(True), VALUES) | st.builds(Case, st.just(False), st.integers(0))


def script(*cases: tuple[Case, ...]) -> Script:
    return Script("client", "FRM-3", "check_it", False, cases, seen="it died", transcript=("a",))


@given(st.lists(st.lists(CASES, max_size=3), max_size=3))
def test_what_is_written_is_read_again(tmp_path_factory, found) -> None:
    path = tmp_path_factory.getbasetemp() / "script.json"
    written = script(*map(tuple, found))
    save(written, path)
    assert repr(load(path)) == repr(written)


def test_zero_keeps_its_sign_and_nan_its_nature(tmp_path: Path) -> None:
    path = tmp_path / "script.json"
    save(script((Case(True, (-0.0, math.nan)),)), path)
    zero, nan = load(path).cases[0][0].value
    assert math.copysign(1, zero) == -1
    assert math.isnan(nan)


def test_a_case_without_a_form_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="no form for"):
        save(script((Case(True, object()),)), tmp_path / "script.json")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"format":"2"}',
        '{"format":"1"}',
        '{"format":"1","cases":[[{}]]}',
        '{"format":"1","cases":[[{"listed":1e400}]]}',
        "[" * 9999,
    ],
)
def test_what_is_no_script_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(ScriptError, match=r"other\.json"):
        load(path)


def test_rows_undoes_flat() -> None:
    cases = ((Case(False, 1), Case(True, 2)), (), (Case(False, 3),))
    assert rows(flat(cases), 3) == cases
