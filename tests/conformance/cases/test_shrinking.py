"""Lists of cases are made smaller, and never into what does not fail."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.shrinking import simplest, smallest, without_one


def always():
    return True


@given(st.sets(st.integers(0, 40), min_size=1, max_size=4))
def test_what_is_left_is_what_was_needed(needed):
    assert set(smallest(range(41), needed.issubset, always)) == needed


def test_the_last_alone_is_tried_first():
    tried = []
    assert smallest(range(10), lambda cases: not tried.append([*cases]), always) == [9]
    assert tried == [[9]]


def test_what_never_fails_again_stays_as_it_is():
    assert smallest([1, 2, 3], lambda cases: False, always) == [1, 2, 3]


@pytest.mark.parametrize("times", [0, 5])
def test_it_ends_when_the_time_is_over(times):
    left = itertools.chain([True] * times, itertools.repeat(False))
    kept = smallest(range(8), lambda cases: 0 in cases, lambda: next(left))
    assert 0 in kept
    assert (len(kept) < 8) == bool(times)


def test_a_case_is_made_simpler_step_by_step():
    case = simplest([*range(20)], without_one, lambda case: {3, 17} <= {*case}, always)
    assert case == [3, 17]
