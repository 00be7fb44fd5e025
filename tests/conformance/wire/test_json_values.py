"""Questions about JSON values."""

import math

import pytest
from splatbus_conformance.wire.json_values import (
    as_cut,
    as_double,
    ascending,
    finite,
    finites,
    integer_in,
    is_handle,
    is_number,
    is_version,
    number_in,
    numbers,
    positive,
    show,
    strings,
    text_of,
    texts,
    whole,
    within,
)

NOT_NUMBERS = [None, True, False, "1", [], {}]


@pytest.mark.parametrize("value", NOT_NUMBERS)
def test_what_is_no_number(value: object) -> None:
    assert not is_number(value)
    assert not number_in(value, 0)
    assert not positive(value)
    assert not integer_in(value, 0)
    assert whole(value) is None


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_passes_but_is_never_reckoned_with(value: float) -> None:
    assert number_in(value, 0, 1)
    assert positive(value)
    assert integer_in(value, 0, 1)
    assert whole(value) is None


def test_integers_may_have_a_fraction_of_zero() -> None:
    assert whole(64.0) == 64
    assert whole(64.5) is None
    assert whole(2**53) is None
    assert whole(-1, 0) is None
    assert integer_in(10**300, 0, 10**300)


@pytest.mark.parametrize("value", ["1.1", "10.20", "0.0"])
def test_versions(value: str) -> None:
    assert is_version(value)


@pytest.mark.parametrize(
    "value",
    [
        "1",
        "01.1",
        "1.01",
        "-1.0",
        "1." + "1" * 63,
        "1.1.0",
        "v1.1",
        "1.1\n",
        "١.١",
        "",
        ".1",
        None,
        1.1,
    ],
)
def test_what_is_no_version(value: object) -> None:
    assert not is_version(value)


def test_handles_are_64_bytes_of_base64() -> None:
    assert is_handle("A" * 86 + "==")
    for wrong in ("A" * 88, "A" * 85 + "==", "-" * 86 + "==", "A" * 86 + "==\n", None):
        assert not is_handle(wrong)


def test_arrays_and_strings() -> None:
    assert numbers([1, 2.5], 2)
    assert not numbers([1, True], 2)
    assert not numbers([1], 2)
    assert strings(["a"]) == ["a"]
    assert strings(["a", 1]) is None
    assert strings("a") is None
    assert text_of("é" * 64, 1, 64)
    assert not text_of("", 1, 64)


def test_values_are_shown_as_json_and_cut() -> None:
    assert show("\ud800") == '"\\ud800"'
    assert show(math.nan) == "NaN"
    assert len(show("x" * 10_000)) < 100


def test_numbers_that_ascend() -> None:
    assert ascending([1, 1, 2], 3)
    assert ascending([1, 2], 2, 4, strictly=True)
    assert ascending([math.inf, 1], 2)
    assert not ascending([1, 1], 2, strictly=True)
    assert not ascending([2, 1], 2)
    assert not ascending([1], 2, 4)
    assert not ascending([1, "2"], 2)
    assert not ascending("12", 2)


def test_a_number_beyond_double_precision_is_infinite() -> None:
    assert as_double(-(10**400)) == -math.inf
    assert as_double(3) == 3.0


def test_what_is_not_there_is_none() -> None:
    message = {"a": [{"b": 1}], "c": None}
    assert within(message, "a", 0, "b") == 1
    assert within(message, "a", -1) == {"b": 1}
    for path in (("a", 1), ("a", "0"), ("c", "d"), ("b",), ("a", 0, "b", "c"), (0,)):
        assert within(message, *path) is None
    assert within("text", 0) is None


@pytest.mark.parametrize("value", [*NOT_NUMBERS, math.nan, math.inf, 10**400, -(10**400)])
def test_what_cannot_be_reckoned_with_is_none(value: object) -> None:
    assert finite(value) is None
    assert finites([1.0, value], 2) is None


def test_what_can_be_reckoned_with() -> None:
    assert finite(3) == 3.0
    assert finites([1, 2.5], 2) == (1.0, 2.5)
    assert finites([], 0) == ()
    assert finites([1.0], 2) is None
    assert finites("12", 2) is None
    assert texts(["a", 1, None, "b"]) == ["a", "b"]
    assert texts({"a": "b"}) == []


@pytest.mark.parametrize(
    ("number", "meant", "words"),
    [
        (1, 2**32 + 1, "cut to 32 bits"),
        (-2, 2**32 - 2, "cut to 32 bits"),
        (5, 2**16 + 5, "cut to 16 bits"),
        (2**24, 2**24 + 1, "rounded to single precision"),
        (7, 7, ""),
        (8, 7, ""),
        ("x", 7, ""),
        (8, None, ""),
    ],
)
def test_how_a_number_was_cut_is_told(number, meant, words):
    assert words in as_cut(number, meant) if words else not as_cut(number, meant)
