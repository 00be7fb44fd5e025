"""The judge's own reading of JSON: it takes what can be taken, and lists what is wrong."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.wire.json_reading import (
    _read_closely,
    nesting,
    read,
    shorten,
    spelled,
    take_numbers,
)
from splatbus_conformance.wire.message_kinds import NUMBER

SPELLINGS = st.recursive(
    st.sampled_from(["0", "-0", "1.5", "1e400", "-1E999", "NaN", "-Infinity", "true", '"\\ud83d"'])
    | st.sampled_from(["9" * 300, "9" * 301, "-" + "9" * 300, '"[{"', '"\\u00e9"', "01", "x"])
    | st.text().map(json.dumps),
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda them: f"[{','.join(them)}]")
        | st.lists(st.tuples(st.sampled_from(["a", "b", "\\u0061"]), inner), max_size=3).map(
            lambda them: "{" + ",".join(f'"{name}":{value}' for name, value in them) + "}"
        )
    ),
    max_leaves=6,
)


@given(SPELLINGS, st.sampled_from([b"", b" ", b"\xef\xbb\xbf", b"\xff"]))
def test_it_reads_as_the_standard_library_does_and_all_as_closely(text: str, mark: bytes) -> None:
    payload = mark + f'{{"a":{text}}}'.encode()
    value, faults = read(payload)
    assert repr((value, faults)) == repr(tuple(_read_closely(payload)))  # NaN is not equal to NaN
    if not faults:
        assert value == json.loads(payload, parse_int=spelled)


@pytest.mark.parametrize(
    ("payload", "requirements", "value"),
    [
        *((payload, ["JSN-1"], None) for payload in (b"", b"{", b"[]", b"null", b'"\xff"')),
        *((payload, ["JSN-1"], None) for payload in (b"{'a':1}", b'{"a":1,}', b'{"a":01}')),
        (b'{"a":["\\ud83d"]}', ["JSN-1"], {"a": ["\ud83d"]}),
        (b'{"\\uDE42":1}', ["JSN-1"], {"\ude42": 1}),
        (b'{"a":"\\ud83d\\ude42"}', [], {"a": "🙂"}),
        (b'{"a":"\\\\ud83d"}', [], {"a": "\\ud83d"}),
        (b"\xef\xbb\xbf{}", ["JSN-2"], {}),
        (b"\xef\xbb\xbf\xef\xbb\xbf{}", ["JSN-2", "JSN-1"], None),
        (b'{"a":1,"a":2}', ["JSN-3"], {"a": 2}),
        (b'{"a":{"b":1,"b":2},"a":0}', ["JSN-3", "JSN-3"], {"a": 0}),
        (b'{"a":-Infinity,"b":1e400}', ["JSN-4", "JSN-4"], {"a": math.nan, "b": math.inf}),
        (b'{"a":' + b"9" * 5000 + b"}", ["JSN-4"], {"a": math.inf}),
        (b'{"a":' + b"[" * 63 + b"]" * 63 + b',"b":"[[' + b'\\"[["}', [], ...),
        (b'{"a":' + b"[" * 64 + b"]" * 64 + b"}", ["JSN-5"], None),
        (b'{"a":' + b"[" * 100_000, ["JSN-5"], None),
    ],
    ids=lambda value: value[:24] if isinstance(value, bytes) else None,
)
def test_faults_and_what_is_taken_all_the_same(
    payload: bytes, requirements: list[str], value: Any
) -> None:
    found = read(payload)
    assert [fault.requirement for fault in found.faults] == requirements
    assert value is ... or repr(found.value) == repr(value)


def test_brackets_in_strings_do_not_nest() -> None:
    texts = ['{"a":[{"b":[]}]}', '{"a":"[[[\\"[["}', '["\\"[', '["[\\', "", "}["]
    assert [*map(nesting, texts)] == [4, 1, 1, 1, 0, 0]


def test_a_decimal_comma_is_told_as_one() -> None:
    _, (fault,) = read(b'{"note":"a:1,5","x":-0,25}')
    assert fault.text == "no JSON: -0,25 is no number: a point is wanted for the comma"
    _, (fault,) = read(b'{"note":"a:1,5",}')
    assert "a point is wanted" not in fault.text


@pytest.mark.parametrize("spelling", ["1.5", "-0", "1e-7", "9.9999999778196309e21", "0"])
def test_strings_that_spell_numbers_are_taken_where_numbers_belong(spelling: str) -> None:
    shape = {"a": NUMBER, "b": {"c": [NUMBER]}, "d": [NUMBER]}
    others = {"name": spelling, "d": {"x": spelling}}
    value, (fault,) = take_numbers({"a": spelling, "b": {"c": [1, spelling]}, **others}, shape)
    number = json.loads(spelling)
    assert value == {"a": number, "b": {"c": [1, number]}, **others}
    assert (fault.requirement, fault.pointer) == ("JSN-4", "/a")


@pytest.mark.parametrize("text", ["", " 1", "1 ", "1_0", "0x1", "nan", "+1", ".5", "1.", "01", "١"])
def test_other_strings_are_left(text: str) -> None:
    assert take_numbers({"a": text}, {"a": NUMBER}) == ({"a": text}, ())


def test_numbers_of_any_length_have_a_value() -> None:
    assert spelled("9" * 300) == int("9" * 300)
    assert spelled("-" + "9" * 6000) == -math.inf


def test_long_texts_are_cut_in_the_middle() -> None:
    assert shorten("a" * 10, 10) == "a" * 10
    assert shorten("a" * 50 + "b" * 50, 10) == "aaaaa…bbbbb (100 characters)"
