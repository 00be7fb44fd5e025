"""Courses of figures."""

from splatbus_viewer.window import figures
from splatbus_viewer.window.figures import Images, Telemetries
from splatbus_wire.messages import Histogram, Scalar, Telemetry, Text


def test_gaps_in_the_numbers_are_images_that_were_dropped() -> None:
    images = Images()
    for number, (generation, seq) in enumerate([(1, 3), (1, 4), (1, 7), (2, 20), (2, 19), (2, 20)]):
        images.shown(generation, seq, None, 1_000_000, 0.1 * number)
    _, dropped = images.dropped.points(0.0)
    assert dropped.tolist() == [0, 0, 2, 0, 0, 0]
    assert (images.count, images.missed) == (6, 2)
    assert images.copied.newest == 1.0


def test_the_rate_is_of_the_last_second() -> None:
    images = Images()
    for at in (0.0, 0.5, 0.9, 1.6):
        images.shown(1, 1, None, 0, at)
    assert images.rate.newest == 2
    _, former = images.rate.points(0.0)
    images.rests(2.5)
    assert images.rate.newest == 2
    images.rests(2.7)
    images.rests(9.0)
    assert images.rate.newest == 0
    assert len(images.rate.points(0.0)[1]) == len(former) + 1


def test_a_server_with_ever_new_names_does_not_fill_the_memory() -> None:
    told = Telemetries()
    assert not told
    for number in range(2000):
        series = Scalar(f"{number}\x1b", 0.0), Text(f"{number}", "a\x1b")
        histogram = Histogram(f"{number}", (0.0, 1.0, 3.0), (4, 2))
        told.take(Telemetry(number, 0.0, (*series, histogram)), float(number))
    for kept in (told.courses, told.histograms, told.texts):
        assert len(kept) == 256
        assert list(kept)[-1].startswith("1999")
    assert "\x1b" not in "".join((*told.courses, *told.texts.values()))
    assert told.histograms["1999"].counts.tolist() == [4, 2]
    course = next(iter(told.courses.values()))
    for number in range(figures.KEPT + 5):
        course.add(float(number), 2.0 * number)
    seconds, values = course.points(float(figures.KEPT + 5))
    assert len(seconds) == len(values) == figures.KEPT
    assert (seconds[0], values[0], course.newest) == (-figures.KEPT, 10.0, values[-1])
