"""The same seed draws the same cases; a search finds worse ones."""

import itertools
import threading
from pathlib import Path

import pytest
from hypothesis import strategies as st
from splatbus_conformance.cases.drawing import climb, draw, leave_nothing_where_the_user_works

CASES = st.lists(st.integers() | st.text() | st.floats(allow_nan=False), max_size=4)


def test_the_same_seed_draws_the_same() -> None:
    assert draw(CASES, 200, 7) == draw(CASES, 200, 7)


def test_another_seed_draws_others() -> None:
    assert draw(CASES, 200, 7) != draw(CASES, 200, 8)


def test_no_more_than_asked_for() -> None:
    assert len(draw(CASES, 30, 0)) <= 30


def test_nothing_is_left_where_the_user_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    leave_nothing_where_the_user_works()
    draw(CASES, 100, 3)
    assert list(tmp_path.iterdir()) == []


def searched(strategy, count, seed, error):
    """What a search draws, and the error of each."""
    found = []
    for case in climb(strategy, count, seed, lambda: {"error": found[-1][1]}):
        found.append((case, error(case)))
    return found


def test_a_case_that_is_not_bad_at_all_leads_nowhere() -> None:
    at_random = draw(NEAR, 100, 5)
    cases = list(climb(NEAR, 100, 5, lambda: {"error": 0.0}))
    assert cases == at_random


NEAR = st.tuples(*3 * [st.integers(-(2**20), 2**20)])


def nearness(case):
    return 2**23 - sum(abs(number - 123_456) for number in case)


def test_a_search_finds_worse_cases_than_drawing_as_many_at_random() -> None:
    """Where an error is the sum of many small ones, as those of rounding are."""

    def error(case):
        return sum((part * 2654435761 >> 7) % 1024 for part in case)

    digits = st.tuples(*8 * [st.integers(0, 2**18)])
    at_random = [max(map(error, draw(digits, 300, seed))) for seed in range(4)]
    climbed = [max(it for _, it in searched(digits, 300, seed, error)) for seed in range(4)]
    assert sum(climbed) > 1.05 * sum(at_random)


def test_a_search_repeats_itself() -> None:
    first = searched(NEAR, 100, 3, nearness)
    assert first == searched(NEAR, 100, 3, nearness)
    assert first != searched(NEAR, 100, "3", nearness)
    assert 50 < len(first) <= 100


def test_a_search_without_scores_is_none() -> None:
    assert len(list(climb(CASES, 60, 0, dict))) > 50


def test_an_error_that_is_no_number_leads_nowhere() -> None:
    assert len(list(climb(NEAR, 60, 0, lambda: {"error": float("nan")}))) > 50


def test_a_search_that_is_left_leaves_no_thread() -> None:
    before = threading.active_count()
    cases = climb(NEAR, 60, 0, lambda: {"error": 1.0})
    assert len(list(itertools.islice(cases, 3))) == 3
    cases.close()
    assert threading.active_count() == before


def test_what_fails_while_a_case_is_drawn_is_raised_where_it_was_wanted() -> None:
    with pytest.raises(ZeroDivisionError):
        list(climb(st.integers().map(lambda number: 1 // 0), 10, 0, dict))
