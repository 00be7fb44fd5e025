"""Questions about JSON values, and readers of those to reckon with."""

import math
from typing import Any

import pytest
from splatbus_conformance.wire.json_values import (
    as_cut,
    ascending,
    finite,
    finites,
    integer_in,
    is_handle,
    is_version,
    number_in,
    numbers,
    positive,
    show,
    strings,
    texts,
    whole,
    within,
)

ENDLESS = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("value", [None, True, "1", [], *ENDLESS, 10**400, -(10**400)])
def test_what_cannot_be_reckoned_with_is_none(value: Any) -> None:
    """Where it is no number; one that is not finite passes, and JSN-4 alone says what is wrong."""
    assert (finite(value), finites([1.0, value], 2), whole(value)) == (None, None, None)
    if not isinstance(value, int) or isinstance(value, bool):
        passes = number_in(value, 0, 1), positive(value), integer_in(value, 0, 1)
        assert passes == (value in ENDLESS,) * 3
        assert numbers([1, value], 2) is (value in ENDLESS)


def test_integers_may_have_a_fraction_of_zero() -> None:
    told = [whole(it, 0) for it in (64.0, 0, 64.5, 2**53, -1)]
    assert told == [64, 0, None, None, None]
    assert integer_in(10**300, 0, 10**300)


def test_versions_and_handles_are_spelled_in_one_way() -> None:
    assert all(map(is_version, ("1.1", "10.20", "0.0")))
    others = ("1", "01.1", "1.01", "-1.0", "1." + "1" * 63, "1.1.0", "1.1\n", "١.١", ".1", 1.1)
    assert not any(map(is_version, others))
    assert is_handle("A" * 86 + "==")
    assert not any(map(is_handle, ("A" * 88, "A" * 85 + "==", "-" * 86 + "==", "A" * 86 + "==\n")))


def test_numbers_that_ascend() -> None:
    assert all(ascending(it, 2, 3) for it in ([1, 1], [1, 1, 2], [math.inf, 1]))
    assert not any(ascending(it, 2, 3) for it in ([2, 1], [1], [1] * 4, [1, "2"], "12"))
    assert not ascending([1, 2, 3], 2)
    assert not ascending([1, 1], 2, strictly=True)


def test_what_is_not_there_is_none() -> None:
    message = {"a": [{"b": 1}], "c": None}
    assert within(message, "a", 0, "b") == within(message, "a", -1, "b") == 1
    for path in (("a", 1), ("a", "0"), ("c", "d"), ("b",), ("a", 0, "b", "c"), (0,)):
        assert within(message, *path) is None
    assert (strings(["a"]), strings(["a", 1]), texts(["a", 1])) == (["a"], None, ["a"])


def test_values_are_shown_as_json_and_cut() -> None:
    assert show(["\ud800", math.nan]) == '["\\ud800", NaN]'
    assert len(show("x" * 10_000)) < 100


@pytest.mark.parametrize(
    ("number", "meant", "words"),
    [
        (1, 2**32 + 1, "cut to 32 bits"),
        (-2, 2**32 - 2, "cut to 32 bits"),
        (5, 2**16 + 5, "cut to 16 bits"),
        (2**24, 2**24 + 1, "rounded to single precision"),
        *((number, meant, "") for number, meant in ((7, 7), (8, 7), ("x", 7), (8, None))),
    ],
)
def test_how_a_number_was_cut_is_told(number: Any, meant: int | None, words: str) -> None:
    assert words in as_cut(number, meant) if words else not as_cut(number, meant)
