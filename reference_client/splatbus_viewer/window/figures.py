"""Courses of figures over the last minutes: what the plots show."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_schemas import LIMITS
from splatbus_schemas.visible import visible
from splatbus_wire.messages import FrameCamera, Histogram, Scalar, Telemetry

from splatbus_viewer.latency import Latencies

KEPT = 1200
Float64Array = NDArray[np.float64]


class Course:
    """A figure at the times at which it was known; the newest twelve hundred.

    Attributes:
        unit: as it is shown.
    """

    def __init__(self, unit: str = "") -> None:
        self.unit = unit
        self._points: deque[tuple[float, float]] = deque(maxlen=KEPT)

    def add(self, time: float, value: float) -> None:
        """Take the figure at a time, in seconds that ascend."""
        self._points.append((time, value))

    @property
    def newest(self) -> float | None:
        """The last value, if there is any."""
        return self._points[-1][1] if self._points else None

    def points(self, now: float) -> tuple[Float64Array, Float64Array]:
        """Return two (N,) float64: seconds before now, which are not positive, and values."""
        numbers = np.array(self._points, np.float64).reshape(-1, 2)
        return numbers[:, 0] - now, np.ascontiguousarray(numbers[:, 1])


class Told(NamedTuple):
    """A histogram of the server's: (N + 1,) edges and (N,) counts, float64."""

    edges: Float64Array
    counts: Float64Array


class Images:
    """What came: how fast, how late, how much was missed and copied.

    Attributes:
        rate: images a second, over the last second.
        dropped: images that were rendered and not seen here, by the gaps in their numbers.
        latency: from a pose to the picture of its image, milliseconds, by its tag.
        copied: megabytes of an image that were copied to show it.
        count: images in all.
        missed: dropped in all.
    """

    def __init__(self) -> None:
        self.rate, self.dropped = Course("/s"), Course("images")
        self.latency, self.copied = Course("ms"), Course("MB")
        self.count = self.missed = 0
        self.latencies = Latencies()
        self._times: deque[float] = deque()
        self._last: tuple[int, int] | None = None

    def shown(
        self, generation: int, seq: int, camera: FrameCamera | None, copied: int, now: float
    ) -> None:
        """Take note that an image is on the screen.

        Args:
            generation: of its memory; numbers of another are not compared with its.
            seq: its number.
            camera: what it was rendered with, where the server says.
            copied: bytes that were copied for it.
            now: seconds on the client's clock.
        """
        if camera is not None:
            self.latencies.shown(camera, now)
            while self.latencies.seconds:
                self.latency.add(now, 1e3 * self.latencies.seconds.popleft())
        self.count += 1
        gap = 0
        if self._last is not None and self._last[0] == generation:
            gap = max(seq - self._last[1] - 1, 0)
        self._last = generation, seq
        self.missed += gap
        self._times.append(now)
        while self._times[0] <= now - 1.0:
            self._times.popleft()
        self.rate.add(now, len(self._times))
        self.dropped.add(now, gap)
        self.copied.add(now, copied / 1e6)

    def rests(self, now: float) -> None:
        """Take note of the time, in seconds: a rate is none any more a second after its images."""
        if self._times and self._times[-1] <= now - 1.0:
            self._times.clear()
            self.rate.add(now, 0)


class Telemetries:
    """The server's own figures, by name, as they come.

    Attributes:
        courses: of numbers.
        histograms: the newest of each.
        texts: the newest of each.
    """

    def __init__(self) -> None:
        self.courses: dict[str, Course] = {}
        self.histograms: dict[str, Told] = {}
        self.texts: dict[str, str] = {}

    def take(self, told: Telemetry, now: float) -> None:
        """Take what came, at a time on the client's clock."""
        for series in told.series:
            name = visible(series.name)
            if isinstance(series, Scalar):
                course = self.courses.setdefault(name, Course(visible(series.unit or "")))
                course.add(now, series.value)
            elif isinstance(series, Histogram):
                edges = np.array(series.edges, np.float64)
                self.histograms[name] = Told(edges, np.array(series.counts, np.float64))
            else:
                self.texts[name] = visible(series.value)
        for kept in (self.courses, self.histograms, self.texts):
            _forget(kept)  # of a server that ever has new ones

    def __bool__(self) -> bool:
        return bool(self.courses or self.histograms or self.texts)


def _forget(kept: dict[str, Any]) -> None:
    for name in list(kept)[: -LIMITS["max_series"]]:
        del kept[name]
