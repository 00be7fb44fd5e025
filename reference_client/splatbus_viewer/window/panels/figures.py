"""The panel of figures: how fast and how late images come, and what the server tells of itself."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui, implot

from splatbus_viewer.window.figures import Course, Told
from splatbus_viewer.window.panels.look import Look

_SECONDS = 30.0
_HEIGHT, _LEAST_WIDTH = 130.0, 250.0


def panel(look: Look) -> None:
    """Describe it: as many plots in a row as have room."""
    talk = look.conversation
    courses = {
        "pose to picture": talk.images.latency,
        "round trip": talk.round_trip,
        "images a second": talk.images.rate,
        "dropped images": talk.images.dropped,
        "copied for an image": talk.images.copied,
    }
    across = imgui.get_content_region_avail().x
    columns = max(int(across / _LEAST_WIDTH), 1)
    imgui.text(
        f"{talk.images.count} images shown, {talk.images.missed} dropped"
        f" - drag and turn the wheel over a plot to move in it, double-click to fit"
    )
    if not imgui.begin_table("##plots", columns):
        return
    for name, course in courses.items():
        imgui.table_next_column()
        _course(name, course, look.now)
    for name, course in talk.telemetries.courses.items():
        imgui.table_next_column()
        _course(f"{name}##server", course, look.now)
    for name, told in talk.telemetries.histograms.items():
        imgui.table_next_column()
        _histogram(f"{name}##server", told)
    for name, text in talk.telemetries.texts.items():
        imgui.table_next_column()
        imgui.text_wrapped(f"{name}: {text}")
    imgui.end_table()
    telemetry = "telemetry" in look.session.status.message.capabilities
    if look.session.status.message.version is not None and not telemetry:
        imgui.text_disabled("the server tells no figures of its own")


def summary(course: Course, name: str) -> str:
    """Return the title of a plot: the last value, and the median and 99th percentile of a wait."""
    title, _, identity = name.partition("##")
    if course.newest is None:
        told = f"{title}: none yet"
    elif course.unit == "ms":
        _, values = course.points(0.0)
        middle, late = (
            f"{each:.{1 if each < 10 else 0}f}" for each in np.percentile(values, [50, 99])
        )
        told = f"{title}: {middle}, p99 {late} ms"
    else:
        told = f"{title}: {course.newest:.4g} {course.unit}".rstrip()
    return f"{told}###{name if identity else title}"


def _course(name: str, course: Course, now: float) -> None:
    flags = implot.Flags_.no_legend | implot.Flags_.no_mouse_text
    if not implot.begin_plot(summary(course, name), imgui.ImVec2(-1, _HEIGHT), flags):
        return
    bare = implot.AxisFlags_.no_label
    implot.setup_axes("", "", bare, bare | implot.AxisFlags_.auto_fit)
    implot.setup_axis_limits(implot.ImAxis_.x1, -_SECONDS, 0.0, implot.Cond_.once)
    seconds, values = course.points(now)
    if len(values):
        implot.plot_line("##line", seconds, values)
    implot.end_plot()


def _histogram(name: str, told: Told) -> None:
    title, _, _ = name.partition("##")
    label = f"{title}: {told.counts.sum():.0f} counted###{name}"
    flags = implot.Flags_.no_legend | implot.Flags_.no_mouse_text
    if not implot.begin_plot(label, imgui.ImVec2(-1, _HEIGHT), flags):
        return
    fit = implot.AxisFlags_.no_label | implot.AxisFlags_.auto_fit
    implot.setup_axes("", "", fit, fit)
    middles, widths = (told.edges[1:] + told.edges[:-1]) / 2, np.diff(told.edges)
    if len(middles):
        implot.plot_bars("##bars", middles, told.counts, float(widths.min()))
    implot.end_plot()
