"""The judge's own reading of JSON: it takes what can be taken, and lists what is wrong."""

import json
import math

import pytest
from hypothesis import given, settings
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

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@settings(deadline=None, max_examples=100)
@given(st.dictionaries(st.text(), VALUES, max_size=4))
def test_sound_messages_read_as_the_standard_library_reads_them(message: dict) -> None:
    payload = json.dumps(message).encode()
    assert read(payload) == (json.loads(payload), ())


@settings(deadline=None, max_examples=200)
@given(st.binary(max_size=60) | st.text(alphabet='{}[]",:\\0e1.-+ntfaNI\ud800', max_size=40))
def test_nothing_makes_it_raise(payload: bytes | str) -> None:
    if isinstance(payload, str):
        payload = payload.encode("utf-8", "surrogatepass")
    value, faults = read(payload)
    assert value is not None or faults


SPELLINGS = st.recursive(
    st.sampled_from(["0", "-0", "1.5", "1e400", "-1E999", "NaN", "-Infinity", "true", '"\\ud83d"'])
    | st.sampled_from(["9" * 300, "9" * 301, "-" + "9" * 300, '"[{"', '"\\u00e9"', "01"]),
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda them: f"[{','.join(them)}]")
        | st.lists(st.tuples(st.sampled_from(["a", "b", "\\u0061"]), inner), max_size=3).map(
            lambda them: "{" + ",".join(f'"{name}":{value}' for name, value in them) + "}"
        )
    ),
    max_leaves=6,
)


@settings(deadline=None, max_examples=300)
@given(SPELLINGS, st.sampled_from(["", " ", "\ufeff", "x"]))
def test_what_looks_faultless_is_read_as_closely_as_the_rest(spelling: str, before: str) -> None:
    payload = f'{before}{{"a":{spelling}}}'.encode()
    assert repr(read(payload)) == repr(_read_closely(payload))  # NaN is not equal to itself


@pytest.mark.parametrize(
    ("payload", "requirements"),
    [
        (b"", ["JSN-1"]),
        (b"{", ["JSN-1"]),
        (b"[]", ["JSN-1"]),
        (b"null", ["JSN-1"]),
        (b'"\xff"', ["JSN-1"]),
        (b"{'a':1}", ["JSN-1"]),
        (b'{"a":1,}', ["JSN-1"]),
        (b'{"a":["\\ud83d"]}', ["JSN-1"]),
        (b'{"\\uDE42":1}', ["JSN-1"]),
        (b'{"a":"\\ud83d\\ude42"}', []),
        (b'{"a":"\\\\ud83d"}', []),
        (b'{"a":01}', ["JSN-1"]),
        (b"\xef\xbb\xbf{}", ["JSN-2"]),
        (b"\xef\xbb\xbf\xef\xbb\xbf{}", ["JSN-2", "JSN-1"]),
        (b'{"a":1,"a":1}', ["JSN-3"]),
        (b'{"a":{"b":1,"b":2},"a":0}', ["JSN-3", "JSN-3"]),
        (b'{"a":NaN}', ["JSN-4"]),
        (b'{"a":-Infinity,"b":1e400}', ["JSN-4", "JSN-4"]),
        (b'{"a":' + b"9" * 400 + b"}", ["JSN-4"]),
        (b'{"a":' + b"9" * 5000 + b"}", ["JSN-4"]),
        (b'{"a":' + b"[" * 64 + b"]" * 64 + b"}", ["JSN-5"]),
        (b'{"a":' + b"[" * 100_000, ["JSN-5"]),
    ],
    ids=lambda value: None if isinstance(value, list) else value[:24],
)
def test_faults(payload: bytes, requirements: list[str]) -> None:
    assert [fault.requirement for fault in read(payload).faults] == requirements


def test_what_can_be_taken_is_taken() -> None:
    assert read(b"\xef\xbb\xbf{}").value == {}
    assert read(b'{"a":1,"a":2}').value == {"a": 2}
    assert read(b'{"a":1e400}').value == {"a": math.inf}


def test_brackets_in_strings_do_not_nest() -> None:
    assert nesting('{"a":"[[[\\"[["}') == 1
    assert nesting('{"a":[{"b":[]}]}') == 4
    assert nesting("") == 0
    assert nesting("}[") == 0
    assert nesting('["\\"[') == 1
    assert nesting('["[\\') == 1


def test_many_members_of_one_name_are_counted_in_time() -> None:
    members = b",".join(b'"%d":0' % i for i in range(60_000))
    assert read(b"{" + members + b"}").faults == ()


def test_a_decimal_comma_is_told_as_one() -> None:
    _, (fault,) = read(b'{"note":"a:1,5","x":-0,25}')
    assert fault.text == "no JSON: -0,25 is no number: a point is wanted for the comma"
    _, (fault,) = read(b'{"note":"a:1,5",}')
    assert "comma" not in fault.text


@pytest.mark.parametrize("spelling", ["1.5", "-0", "1e-7", "9.9999999778196309e21", "0"])
def test_strings_that_spell_numbers_are_taken_where_numbers_belong(spelling: str) -> None:
    shape = {"a": NUMBER, "b": {"c": [NUMBER]}}
    value, faults = take_numbers({"a": spelling, "b": {"c": [1, spelling]}}, shape)
    number = json.loads(spelling)
    assert value == {"a": number, "b": {"c": [1, number]}}
    assert [(fault.requirement, fault.pointer) for fault in faults] == [("JSN-4", "/a")]


@pytest.mark.parametrize("text", ["", " 1", "1 ", "1_0", "0x1", "nan", "+1", ".5", "1.", "01", "١"])
def test_other_strings_are_left(text: str) -> None:
    message = {"a": text, "name": "1.5"}
    assert take_numbers(message, {"a": NUMBER}) == (message, ())


def test_a_shape_that_does_not_fit_changes_nothing() -> None:
    for message in ({"a": ["1"]}, {"a": {"b": "1"}}, {"a": None}, {}):
        assert take_numbers(message, {"a": NUMBER, "b": {"c": NUMBER}}) == (message, ())


def test_numbers_of_any_length_have_a_value() -> None:
    assert spelled("9" * 300) == int("9" * 300)
    assert spelled("9" * 310) == math.inf
    assert spelled("-" + "9" * 6000) == -math.inf


def test_long_texts_are_cut_in_the_middle() -> None:
    assert shorten("short") == "short"
    assert shorten("a" * 50 + "b" * 50, 10) == "aaaaa…bbbbb (100 characters)"
