"""The same seed draws the same cases; a search finds worse ones."""

import itertools
import threading

import pytest
from hypothesis import strategies as st
from splatbus_conformance.cases.drawing import climb, draw, leave_nothing_where_the_user_works

NEAR = st.tuples(*3 * [st.integers(-(2**20), 2**20)])


def test_the_same_seed_draws_the_same_and_no_more_than_asked_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    leave_nothing_where_the_user_works()
    assert draw(NEAR, 200, 7) == draw(NEAR, 200, 7) != draw(NEAR, 200, 8)
    assert len(draw(NEAR, 30, 0)) <= 30
    assert not [*tmp_path.iterdir()]


def searched(strategy, count, seed, error):
    """What a search draws, and the error of each."""
    found = []
    for case in climb(strategy, count, seed, lambda: {"error": found[-1][1]}):
        found.append((case, error(case)))
    return found


@pytest.mark.parametrize("scores", [{}, {"error": 0.0}, {"error": float("nan")}])
def test_a_case_that_is_not_bad_at_all_leads_nowhere(scores):
    assert [*climb(NEAR, 100, 5, lambda: scores)] == draw(NEAR, 100, 5)


def test_a_search_repeats_itself_and_finds_worse_cases_than_as_many_at_random():
    """Where an error is the sum of many small ones, as those of rounding are."""

    def error(case):
        return sum((part * 2654435761 >> 7) % 1024 for part in case)

    digits = st.tuples(*8 * [st.integers(0, 2**18)])
    at_random = [max(map(error, draw(digits, 300, seed))) for seed in range(4)]
    searches = [searched(digits, 300, seed, error) for seed in range(4)]
    climbed = [max(it for _, it in search) for search in searches]
    assert sum(climbed) > 1.05 * sum(at_random)
    assert searches[3] == searched(digits, 300, 3, error) != searched(digits, 300, "3", error)
    assert 150 < len(searches[3]) <= 300


def test_a_search_that_is_left_leaves_no_thread():
    before = threading.active_count()
    cases = climb(NEAR, 60, 0, lambda: {"error": 1.0})
    assert len([*itertools.islice(cases, 3)]) == 3
    cases.close()
    assert threading.active_count() == before


def test_what_fails_while_a_case_is_drawn_is_raised_where_it_was_wanted():
    with pytest.raises(ZeroDivisionError):
        [*climb(st.integers().map(lambda number: 1 // 0), 10, 0, dict)]
