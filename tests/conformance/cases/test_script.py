"""Scripts are written and read again without loss, and what is none is refused in words."""

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


def script(*cases):
    return Script("client", "FRM-3", "check_it", False, cases, seen="it died", transcript=("a",))


@given(st.lists(st.lists(CASES, max_size=3), max_size=3))
def test_what_is_written_is_read_again(tmp_path_factory, found):
    path = tmp_path_factory.getbasetemp() / "script.json"
    written = script(*map(tuple, found))
    save(written, path)
    assert repr(load(path)) == repr(written)  # of -0.0 and NaN, too
    assert repr(rows(flat(written.cases), len(found))) == repr(written.cases)


def test_a_case_without_a_form_is_refused(tmp_path):
    with pytest.raises(TypeError, match="no form for"):
        save(script((Case(True, object()),)), tmp_path / "script.json")


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", "{}", '{"format":"2"}', '{"format":"1"}', "[" * 9999),
        '{"format":"1","cases":[[{}]]}',
        '{"format":"1","cases":[[{"listed":1e400}]]}',
    ],
)
def test_what_is_no_script_is_refused_with_its_name(tmp_path, text):
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(ScriptError, match=r"other\.json"):
        load(path)
