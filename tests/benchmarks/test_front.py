"""Which points are on the front is what the pictures, and the choice of defaults, stand on."""

from hypothesis import given
from hypothesis import strategies as st

from benchmarks.accuracy.front import LIKE, Point, beats, front


def point(time, error, spread=0.01):
    return Point(time * (1 - spread), time, time * (1 + spread), error)


times = st.floats(0.1, 1e6)
errors = st.just(0.0) | st.floats(1e-20, 1e20)
points = st.lists(st.builds(point, times, errors, st.floats(0.0, 0.5)), min_size=1, max_size=12)


def test_faster_and_more_accurate_beats():
    assert beats(point(1, 1), point(2, 2))
    assert not beats(point(2, 2), point(1, 1))


def test_faster_but_less_accurate_does_not():
    assert not beats(point(1, 2), point(2, 1))
    assert not beats(point(2, 1), point(1, 2))


def test_a_difference_within_the_noise_of_both_decides_nothing():
    assert not beats(point(1.0, 1.0, 0.1), point(1.05, 1.0, 0.1))
    assert not beats(point(1.0, 1.0, 0.1), point(1.05, 1.0 * LIKE, 0.1))
    assert beats(point(1.0, 1.0, 0.1), point(1.3, 1.0, 0.1))
    assert beats(point(1.0, 1.0, 0.1), point(1.05, 1.2 * LIKE, 0.1))


def test_no_error_beats_any_and_two_without_are_decided_by_time():
    assert beats(point(1, 0.0), point(1, 1e-300))
    assert beats(point(1, 0.0), point(2, 0.0))
    assert not beats(point(1, 0.0), point(1, 0.0))


def test_the_front_of_a_picture():
    picture = [point(1, 1e6), point(2, 8), point(2.5, 1e3), point(3, 8), point(100, 0.5)]
    assert front(picture) == [0, 1, 4]


@given(points)
def test_somebody_is_always_on_the_front_the_fastest_of_the_most_accurate_among_them(picture):
    best = min(range(len(picture)), key=lambda i: (picture[i].error, picture[i].time))
    assert best in front(picture)


@given(points)
def test_who_is_off_the_front_is_beaten_by_someone(picture):
    on = front(picture)
    for i, each in enumerate(picture):
        assert (i in on) != any(beats(other, each) for other in picture)


@given(points)
def test_nobody_beats_itself_or_one_that_beats_it(picture):
    assert not any(beats(a, b) and beats(b, a) for a in picture for b in picture)


@given(points, times, errors)
def test_one_that_is_worse_in_everything_changes_nothing(picture, time, error):
    slowest = max(each.high for each in picture)
    least = max(each.error for each in picture)
    worse = point(2 * slowest + time, 2 * least + error + 1)
    assert front([*picture, worse]) == front(picture)
