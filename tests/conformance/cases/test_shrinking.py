"""Lists of cases are made smaller, and never into what does not fail."""

from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.shrinking import simplest, smallest, without_one


def always() -> bool:
    return True


@given(st.sets(st.integers(0, 40), min_size=1, max_size=4))
def test_what_is_left_is_what_was_needed(needed: set[int]) -> None:
    assert set(smallest(range(41), needed.issubset, always)) == needed


def test_the_last_alone_is_tried_first() -> None:
    tried: list[list[int]] = []

    def fails(cases: list[int]) -> bool:
        tried.append(list(cases))
        return 9 in cases

    assert smallest(range(10), fails, always) == [9]  # type: ignore[arg-type]
    assert tried == [[9]]


def test_what_never_fails_again_stays_as_it_is() -> None:
    assert smallest([1, 2, 3], lambda cases: False, always) == [1, 2, 3]


def test_nothing_is_tried_when_there_is_no_time() -> None:
    assert smallest([1, 2, 3], lambda cases: 1 / 0 > 0, lambda: False) == [1, 2, 3]


def test_it_ends_when_the_time_is_over() -> None:
    left = iter([True] * 5)
    kept = smallest(range(8), lambda cases: 0 in cases, lambda: next(left, False))
    assert 0 in kept
    assert len(kept) < 8


def test_a_case_is_made_simpler_step_by_step() -> None:
    case = simplest(list(range(20)), without_one, lambda case: {3, 17} <= set(case), always)
    assert case == [3, 17]


def test_a_case_that_cannot_be_simpler_stays() -> None:
    assert simplest([1], without_one, lambda case: 1 in case, always) == [1]
