import json
import math
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_schemas import LIMITS
from splatbus_wire import json_text
from splatbus_wire.errors import ProtocolError
from splatbus_wire.json_bounds import check_values
from splatbus_wire.json_text import parse_object, serialize

DEPTH = LIMITS["max_json_depth"]

text = st.text(st.characters(exclude_categories=["Cs"]))
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | text,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(text, inner, max_size=4),
    max_leaves=20,
)  # fmt: skip
objects = st.dictionaries(text, values, max_size=6)


def refusal(payload: bytes) -> ProtocolError:
    with pytest.raises(ProtocolError) as caught:
        parse_object(payload)
    return caught.value


def nested(depth: int, opening: str = '{"a":', closing: str = "}") -> bytes:
    return (opening * depth + "1" + closing * depth).encode()


@given(objects, st.booleans(), st.sampled_from([None, 2]))
def test_every_spelling_of_an_object_is_taken(message, ascii_only, indent):
    payload = json.dumps(message, ensure_ascii=ascii_only, indent=indent).encode()
    assert parse_object(b" \r\n\t" + payload + b"\n ") == message


@given(objects)
def test_what_is_serialized_parses_to_the_same(message):
    payload = serialize(message)
    assert parse_object(payload) == message
    assert json.loads(payload) == message


def test_serialized_text_is_compact_and_keeps_every_digit():
    message = {"a": [1.0, -0.0, 0.1, 5e-324, sys.float_info.max], "ä": "é\n"}
    assert serialize(message) == (
        '{"a":[1.0,-0.0,0.1,5e-324,1.7976931348623157e+308],"ä":"é\\n"}'.encode()
    )


@pytest.mark.parametrize(
    ("spelling", "value"),
    [
        ("27.071748733520509", 27.071748733520509),
        ("-0.0", -0.0),
        ("1e-7", 1e-7),
        ("9.9999999778196309e21", 9.9999999778196309e21),
        ("1E+2", 100.0),
        ("1e-400", 0.0),
        ("9" * 300, int("9" * 300)),
        ("0." + "3" * 10_000, 1 / 3),
    ],
)
def test_numbers_are_taken_however_they_are_spelt(spelling, value):
    assert parse_object(f'{{"a":{spelling}}}'.encode())["a"] == value


def test_escapes_in_names_and_strings_are_taken():
    assert parse_object(rb'{"\u0061":"\ud83d\uDE00 \\ud800 \"[{"}') == {"a": '😀 \\ud800 "[{'}


@given(st.lists(st.sampled_from(["d800", "dbff", "dc00", "dFFF", "D83D", "Dc36", "0061", "e000"])))
def test_escapes_of_surrogates_are_taken_in_pairs_only(codes):
    payload = '{{"a":"{}"}}'.format("".join(rf"\u{code}" for code in codes)).encode()
    utf_16 = b"".join(bytes.fromhex(code) for code in codes)
    text = utf_16.decode("utf-16-be", errors="replace")
    if "\ufffd" not in text:
        assert parse_object(payload) == {"a": text}
    else:
        error = refusal(payload)
        assert (error.code, error.requirement) == ("malformed_json", "JSN-1")


# payload, code, requirement, offset
MALFORMED = {
    "empty": (b"", "JSN-1", 0),
    "white space": (b"  ", "JSN-1", 2),
    "no JSON": (b"GET / HTTP/1.1", "JSN-1", 0),
    "single quotes": (b"{'a':1}", "JSN-1", 1),
    # Python names the comma since 3.13, before that what follows it.
    "trailing comma": (b'{"a":1,}', "JSN-1", 6 if sys.version_info >= (3, 13) else 7),
    "trailing text": (b'{"a":1} {}', "JSN-1", 8),
    "trailing NUL": (b'{"a":1}\0', "JSN-1", 7),
    "cut short": (b'{"a":', "JSN-1", 5),
    "offset counts bytes": ('{"ä":x}'.encode(), "JSN-1", 6),
    "raw control character": (b'{"a":"\n"}', "JSN-1", 6),
    "leading zero": (b'{"a":01}', "JSN-1", 6),
    "leading plus": (b'{"a":+1}', "JSN-1", 5),
    "other digits": ('{"a":١}'.encode(), "JSN-1", 5),
    "other white space": ('{"a":\u00a01}'.encode(), "JSN-1", 5),
    "invalid UTF-8": (b'{"a":"\xff"}', "JSN-1", 6),
    "overlong UTF-8": (b'{"a":"\xc0\xaf"}', "JSN-1", 6),
    "encoded surrogate": (b'{"a":"\xed\xa0\x80"}', "JSN-1", 6),
    "UTF-16": ('{"a":1}'.encode("utf-16-le"), "JSN-1", 1),
    "first half of a pair": (rb'{"a":"\ud800"}', "JSN-1", 6),
    "second half of a pair": (rb'{"a":"\uDC00"}', "JSN-1", 6),
    "pair in the wrong order": (rb'{"a":"\udc00\ud800"}', "JSN-1", 6),
    "half a pair in a name": ('{"ä":0,"\\\\\\ud800x":1}'.encode(), "JSN-1", 11),
    "byte-order mark": (b"\xef\xbb\xbf{}", "JSN-2", 0),
    "nested too deep": (nested(DEPTH + 1), "JSN-5", 5 * DEPTH),
    "10,000 brackets": (b"[" * 10_000, "JSN-5", DEPTH),
    "10,000 braces": (b'{"":' * 10_000, "JSN-5", 4 * DEPTH),
    "deep after a string": (b'{"[[\\"\\\\":' + b"[" * 90, "JSN-5", 9 + DEPTH),
}


@pytest.mark.parametrize(("payload", "requirement", "offset"), MALFORMED.values(), ids=MALFORMED)
def test_malformed_text_is_refused_with_the_offset_of_the_fault(payload, requirement, offset):
    error = refusal(payload)
    assert (error.code, error.requirement) == ("malformed_json", requirement)
    assert error.offset == offset
    assert error.pointer is None


@pytest.mark.parametrize(
    ("payload", "shown"),
    [
        (b"null", "null"),
        (b"true", "true"),
        (b"1", "a number"),
        (b'"a"', "a string"),
        (b"[{}]", "an array"),
    ],
)
def test_a_payload_that_is_no_object_is_refused(payload, shown):
    error = refusal(payload)
    assert (error.code, error.requirement, error.pointer) == ("not_an_object", "JSN-1", "")
    assert f"is {shown}" in error.message


@pytest.mark.parametrize(
    ("payload", "pointer"),
    [
        (b'{"a":1,"a":1}', "/a"),
        (b'{"a":1,"\\u0061":1}', "/a"),
        (b'{"p":{"q":[0,{"x~/":1,"b":2,"x~/":3}]}}', "/p/q/1/x~0~1"),
    ],
)
def test_a_repeated_name_is_refused_with_a_pointer(payload, pointer):
    error = refusal(payload)
    assert (error.code, error.requirement) == ("malformed_json", "JSN-3")
    assert error.pointer == pointer


@pytest.mark.parametrize(
    "number",
    ["NaN", "Infinity", "-Infinity", "1e400", "-1e400", "9" * 400, "1" * 5000, "9" * 1_000_000],
    ids=lambda number: number[:9],
)
@pytest.mark.parametrize("shape", ['{"a":[0,{"b":%s}]}', '{"a":[0,{"b":%s}],"b":NaN}'])
def test_a_number_that_is_not_finite_is_refused_with_a_pointer(number, shape):
    error = refusal((shape % number).encode())
    assert (error.code, error.requirement) == ("invalid_number", "JSN-4")
    assert error.pointer == "/a/1/b"
    assert len(str(error)) < 200


def test_text_that_is_malformed_after_a_bad_number_is_refused():
    assert refusal(b'{"a":NaN,}').code == "malformed_json"


def test_nesting_up_to_the_limit_is_taken():
    assert parse_object(nested(DEPTH))
    assert parse_object(b'{"a":' + nested(DEPTH - 1, "[", "]") + b"}")
    assert parse_object(b'{"a":[' + b"{}," * 1000 + b'"[[[\\"]"]}')


MOST = LIMITS["max_server_values"]
LIVELY = b'" \\\\\\" [{,:}] "'
"""A string in which everything stands that structure is made of."""


@given(
    st.recursive(
        st.sampled_from([b"0", b"[]", b"{ \t}", b'""', LIVELY]),
        lambda inner: st.lists(inner, min_size=1, max_size=5).map(
            lambda items: b"[ " + b" ,".join(items) + b"]"
        ),
    )
)
def test_values_are_counted_exactly(value):
    def count(item):
        return 1 + sum(map(count, item)) if isinstance(item, list) else 1

    payload = b'{"a\\"[":' + value + b"}"
    values = 1 + count(json.loads(payload)['a"['])
    check_values(payload, values)
    with pytest.raises(ProtocolError, match=f"more than {values - 1} values"):
        check_values(payload, values - 1)


@pytest.mark.parametrize(
    "unit",
    [b"0,", b"{},", b'"",', b"[", b"[]", b'{"":', LIVELY + b","],
    ids=repr,
)
def test_too_many_values_are_refused_before_they_are_parsed(unit, monkeypatch):
    monkeypatch.setattr(json_text, "STRICT", None)
    error = refusal(b'{"a":[' + unit * (3 * MOST) + b"NaN]}")
    assert (error.code, error.requirement) == ("malformed_json", "JSN-12")
    assert str(MOST) in error.message


def test_as_many_values_as_are_allowed_are_taken():
    message = parse_object(b'{"a":[' + b",".join([LIVELY] * (MOST - 2)) + b"]}")
    assert len(message["a"]) == MOST - 2


def test_deep_nesting_is_refused_with_little_stack_left():
    def deep(frames: int) -> ProtocolError:
        return refusal(b'{"":' * 10_000) if frames == 0 else deep(frames - 1)

    # pytest and Hypothesis stand on some of it already
    assert deep(sys.getrecursionlimit() // 2).requirement == "JSN-5"


@given(st.binary(max_size=40) | st.text('{}[]":,\\u0d8ce1 \n', max_size=40).map(str.encode))
def test_any_bytes_give_an_object_or_a_refusal(payload):
    try:
        message = parse_object(payload)
    except ProtocolError as error:
        located = error.pointer is not None or error.offset is not None
    else:
        located = json.loads(payload) == message
    assert located


def test_a_pointer_is_never_longer_than_an_error_can_carry():
    error = refusal(b'{"a":{"' + b"k" * 500_000 + b'":[' + b"0," * 1000 + b"NaN]}}")
    assert error.pointer == "/a"
    error = refusal(b'{"a":{"%s":1,"%s":1}}' % ((b"k" * 500_000,) * 2))
    assert error.pointer == "/a"
    assert len(str(error)) < 200


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_never_sent(number):
    with pytest.raises(ProtocolError) as caught:
        serialize({"a": ({"b": number},)})
    assert (caught.value.code, caught.value.requirement) == ("invalid_number", "JSN-4")
    assert caught.value.pointer == "/a/0/b"


def test_half_a_surrogate_pair_is_never_sent():
    with pytest.raises(ProtocolError) as caught:
        serialize({"a": "\ud800"})
    assert caught.value.requirement == "JSN-1"


def test_deep_nesting_is_never_sent():
    message: dict[str, object] = {}
    for _ in range(DEPTH):
        message = {"a": message}
    with pytest.raises(ProtocolError) as caught:
        serialize(message)
    assert caught.value.requirement == "JSN-5"


def test_more_values_than_there_may_be_are_never_sent():
    most = {"type": "x", "list": ([0] * (LIMITS["max_server_values"] - 6), {"a": None})}
    assert len(serialize(most)) > 2 * LIMITS["max_server_values"]
    serialize(most | {"list": "0," * 100_000})
    with pytest.raises(ProtocolError) as caught:
        serialize(most | {"more": 0})
    assert (caught.value.code, caught.value.requirement) == ("malformed_json", "JSN-12")
