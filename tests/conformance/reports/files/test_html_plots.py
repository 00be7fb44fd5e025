"""Plots of a page: where bars, marks and words stand."""

import math

import pytest
from splatbus_conformance.reports.files.html import plots


def test_an_axis_holds_its_values_between_powers_of_ten() -> None:
    axis = plots.decades_around([0.0004, 0.02])
    assert (axis.low, axis.high) == (-4, -1)
    assert axis.x(1e-4) == 0.0
    assert axis.x(1e-1) == plots.WIDTH
    assert axis.x(10**-2.5) == plots.WIDTH / 2
    assert [(tick.x, tick.label) for tick in axis.ticks()] == [
        (0.0, "100 µs"),
        (pytest.approx(plots.WIDTH / 3, abs=0.01), "1 ms"),
        (pytest.approx(plots.WIDTH * 2 / 3, abs=0.01), "10 ms"),
        (plots.WIDTH, "100 ms"),
    ]


@pytest.mark.parametrize("values", [[], [0.0], [1.0], [math.inf], [1e-300, 1e300]])
def test_any_values_have_an_axis(values: list[float]) -> None:
    axis = plots.decades_around(values)
    assert 1 <= axis.high - axis.low <= plots.MOST_DECADES
    for value in [*values, 0.0, math.inf, 5e-324]:
        assert 0.0 <= axis.x(value) <= plots.WIDTH


def test_bars_are_as_high_as_they_count_and_one_answer_is_to_be_seen() -> None:
    axis = plots.decades_around([1.0, 10.0])
    path = plots.bars([(1.0, 2.0, 10_000), (2.0, 5.0, 5000), (9.0, 10.0, 1)], axis)
    tops = [float(each.split("V")[1].split("H")[0]) for each in path.split("M")[1:]]
    assert tops == [0.0, plots.HEIGHT / 2, plots.HEIGHT - 1.5]


@pytest.mark.parametrize(
    ("worst", "budget", "x", "words"),
    [
        (0.0, 3.0, 0.0, "exact"),
        (0.0, 0.0, 0.0, "exact"),
        (1.0, 0.0, plots.ROW_WIDTH, "beyond: it had to be exact"),
        (None, 3.0, plots.ROW_WIDTH, "not finite"),
        (3.0, 3.0, plots.AT_BUDGET, "100% of the budget"),
        (0.3, 3.0, plots.AT_BUDGET - plots.ROW_WIDTH / 5, "10% of the budget"),
        (3e-9, 3.0, 0.0, "next to nothing"),
        (60.0, 3.0, plots.ROW_WIDTH, "20 times the budget"),
        (1e308, 5e-324, plots.ROW_WIDTH, "inf times the budget"),
    ],
)
def test_an_error_stands_against_its_budget(
    worst: float | None, budget: float, x: float, words: str
) -> None:
    assert plots.of_budget(worst, budget) == pytest.approx(x)
    assert plots.against(worst, budget) == words


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 µs"),
        (4.2e-8, "0.042 µs"),
        (0.000504, "504 µs"),
        (0.0009996, "1 ms"),
        (0.0234, "23.4 ms"),
        (1.0, "1 s"),
        (1234.0, "1,234 s"),
        (12345678.0, "1.23e7 s"),
    ],
)
def test_durations_read_well(seconds: float, text: str) -> None:
    assert plots.duration(seconds) == text


@pytest.mark.parametrize(
    ("number", "text"),
    [(0.0, "0"), (3.0, "3"), (0.00392, "0.00392"), (1e-6, "1e-6"), (32712345678.0, "3.27e10")],
)
def test_numbers_have_three_digits(number: float, text: str) -> None:
    assert plots.digits(number) == text
