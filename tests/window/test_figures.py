"""Courses of figures."""

import numpy as np
from splatbus_viewer.window import figures
from splatbus_viewer.window.figures import Course, Images, Telemetries
from splatbus_wire.messages import FrameCamera, Histogram, Scalar, Telemetry, Text
from splatbus_wire.poses import IDENTITY


def camera(tag: str | None = None) -> FrameCamera:
    return FrameCamera(IDENTITY, 1.0, 1.0, 0.5, 0.5, 1, 1, 0.1, 10.0, tag)


def test_a_course_keeps_the_newest_points_before_now() -> None:
    course = Course("ms")
    for number in range(figures.KEPT + 5):
        course.add(float(number), 2.0 * number)
    seconds, values = course.points(float(figures.KEPT + 5))
    assert len(seconds) == len(values) == figures.KEPT
    assert (seconds[0], values[0]) == (-figures.KEPT, 10.0)
    assert seconds[-1] == -1.0
    assert course.newest == values[-1]


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


def test_a_wait_ends_with_the_first_image_that_has_the_tag() -> None:
    images = Images()
    images.latencies.asked_for("a", 1.0)
    images.latencies.asked_for("b", 1.1)
    for at, tag in ((1.2, None), (1.3, "b"), (1.4, "b")):
        images.shown(1, 1, camera(tag), 0, at)
    _, waits = images.latency.points(0.0)
    assert np.allclose(waits, [200.0])


def test_figures_of_the_server_are_kept_by_name_and_made_harmless() -> None:
    told = Telemetries()
    assert not told
    series = (
        Scalar("loss\x1b[2J", 0.5),
        Histogram("times", (0.0, 1.0, 3.0), (4, 2)),
        Text("s", "x"),
    )
    told.take(Telemetry(1, 0.0, series), 10.0)
    told.take(Telemetry(2, 0.1, (Scalar("loss\x1b[2J", 0.25),)), 11.0)
    ((name, course),) = told.courses.items()
    assert "\x1b" not in name
    assert course.points(11.0)[1].tolist() == [0.5, 0.25]
    assert told.histograms["times"].counts.tolist() == [4, 2]
    assert told.texts == {"s": "x"}


def test_a_server_with_ever_new_names_does_not_fill_the_memory() -> None:
    told = Telemetries()
    for number in range(2000):
        told.take(Telemetry(number, 0.0, (Scalar(f"series {number}", 0.0),)), float(number))
    assert len(told.courses) <= 256
    assert "series 1999" in told.courses
