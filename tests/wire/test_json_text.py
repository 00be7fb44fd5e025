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

from tests.wire.payloads import refusal

DEPTH = LIMITS["max_json_depth"]


def nested(depth: int, opening: str = '{"a":', closing: str = "}") -> bytes:
    return (opening * depth + "1" + closing * depth).encode()


def test_serialized_text_is_compact_and_keeps_every_digit():
    message = {"a": [1.0, -0.0, 0.1, 5e-324, sys.float_info.max], "ä": "é\n"}
    assert serialize(message) == (
        '{"a":[1.0,-0.0,0.1,5e-324,1.7976931348623157e+308],"ä":"é\\n"}'.encode()
    )


# Where the offset is that of a byte, and the pointer one to a value.
REFUSED = [
    (b"", "malformed_json", "JSN-1", 0),
    # Python names the comma since 3.13, before that what follows it.
    (b'{"a":1,}', "malformed_json", "JSN-1", 6 if sys.version_info >= (3, 13) else 7),
    (b'{"a":1} {}', "malformed_json", "JSN-1", 8),
    ('{"ä":x}'.encode(), "malformed_json", "JSN-1", 6),
    (b'{"a":"\xff"}', "malformed_json", "JSN-1", 6),
    ('{"ä":0,"\\\\\\ud800x":1}'.encode(), "malformed_json", "JSN-1", 11),
    (b"\xef\xbb\xbf{}", "malformed_json", "JSN-2", 0),
    (nested(DEPTH + 1), "malformed_json", "JSN-5", 5 * DEPTH),
    (b'{"":' * 10_000, "malformed_json", "JSN-5", 4 * DEPTH),
    (b'{"[[\\"\\\\":' + b"[" * 90, "malformed_json", "JSN-5", 9 + DEPTH),
    (b'{"p":{"q":[0,{"x~/":1,"b":2,"x~\\/":3}]}}', "malformed_json", "JSN-3", "/p/q/1/x~0~1"),
    *(
        (shape % number, "invalid_number", "JSN-4", "/a/1/b")
        for number in (b"NaN", b"Infinity", b"-Infinity", b"1e400", b"9" * 400, b"-" + b"9" * 10**6)
        for shape in (b'{"a":[0,{"b":%s}]}', b'{"a":[0,{"b":%s}],"b":NaN}')
    ),
]


@pytest.mark.parametrize(
    ("payload", "code", "requirement", "where"),
    REFUSED,
    ids=lambda value: repr(value)[:20] if isinstance(value, bytes) else None,
)
def test_what_is_no_object_of_values_is_refused_with_its_place(payload, code, requirement, where):
    error = refusal(parse_object, payload)
    assert (error.code, error.requirement) == (code, requirement)
    assert where in ([error.offset] if error.pointer is None else [error.pointer])
    assert len(str(error)) < 200


def test_an_error_says_what_stands_in_place_of_an_object():
    for payload, shown in [(b"null", "null"), (b"1", "a number"), (b"[{}]", "an array")]:
        error = refusal(parse_object, payload)
        assert (error.code, error.requirement, error.pointer) == ("not_an_object", "JSN-1", "")
        assert f"is {shown}" in error.message


def test_nesting_up_to_the_limit_is_taken():
    assert parse_object(nested(DEPTH))
    assert parse_object(b'{"a":' + nested(DEPTH - 1, "[", "]") + b"}")
    assert parse_object(b'{"a":[' + b"{}," * 1000 + b'"[[[\\"]"]}')


MOST = LIMITS["max_server_values"]
SENT = {"type": "x", "list": ([0] * (MOST - 6), {"a": None})}
"""As many values as a packet may hold."""
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
    error = refusal(parse_object, b'{"a":[' + unit * (3 * MOST) + b"NaN]}")
    assert (error.code, error.requirement) == ("malformed_json", "JSN-12")
    assert str(MOST) in error.message


def test_as_many_values_as_are_allowed_are_taken():
    message = parse_object(b'{"a":[' + b",".join([LIVELY] * (MOST - 2)) + b"]}")
    assert len(message["a"]) == MOST - 2


def test_deep_nesting_is_refused_with_little_stack_left():
    def deep(frames: int) -> ProtocolError:
        return refusal(parse_object, b'{"":' * 10_000) if frames == 0 else deep(frames - 1)

    # pytest and Hypothesis stand on some of it already
    assert deep(sys.getrecursionlimit() // 2).requirement == "JSN-5"


def test_a_pointer_is_never_longer_than_an_error_can_carry():
    error = refusal(parse_object, b'{"a":{"' + b"k" * 500_000 + b'":[' + b"0," * 1000 + b"NaN]}}")
    assert error.pointer == "/a"
    error = refusal(parse_object, b'{"a":{"%s":1,"%s":1}}' % ((b"k" * 500_000,) * 2))
    assert error.pointer == "/a"
    assert len(str(error)) < 200


def in_objects(value: object, depth: int) -> object:
    return {"a": in_objects(value, depth - 1)} if depth else value


@pytest.mark.parametrize(
    ("message", "code", "requirement", "pointer"),
    [
        *(
            ({"a": ({"b": number},)}, "invalid_number", "JSN-4", "/a/0/b")
            for number in (math.nan, math.inf, -math.inf)
        ),
        ({"a": "\ud800"}, "malformed_json", "JSN-1", None),
        (in_objects({}, DEPTH), "malformed_json", "JSN-5", None),
        (SENT | {"more": 0}, "malformed_json", "JSN-12", None),
    ],
)
def test_what_nobody_may_receive_is_never_sent(message, code, requirement, pointer):
    error = refusal(serialize, message)
    assert (error.code, error.requirement, error.pointer) == (code, requirement, pointer)


def test_as_many_values_as_there_may_be_are_sent():
    assert len(serialize(SENT)) > 2 * MOST
    serialize(SENT | {"list": "0," * 100_000})
