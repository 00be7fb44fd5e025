"""What a scene consists of, and how it looks at a second of it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Union

from splatbus_wire.messages import Box

from splatbus_splats.files.spacetime import Motion, moved, reached
from splatbus_splats.gaussians import Gaussians

SLACK = 1e-3
"""Of the time for which a file of a sequence is shown."""


@dataclass(frozen=True, eq=False)
class Frames:
    """One file, or a sequence of them: the newest is shown, from its time on until the next.

    Attributes:
        files: at least one.
        rate: how many a second.
    """

    files: tuple[Gaussians, ...]
    rate: float = 30.0

    @cached_property
    def most(self) -> int:
        """How many Gaussians one of them has, at the most."""
        return max(map(len, self.files))

    @cached_property
    def degree(self) -> int:
        """The highest of their harmonics."""
        return max(each.degree for each in self.files)

    @cached_property
    def bounds(self) -> Box | None:
        """The box of the centres of all."""
        return enclosing(*(each.bounds for each in self.files))

    @cached_property
    def times(self) -> list[float]:
        """Of each file, seconds."""
        return [i / self.rate for i in range(len(self.files))]

    @property
    def last(self) -> float:
        """When the last one comes, seconds; 0 where there is one."""
        return self.times[-1]

    @property
    def loop(self) -> float:
        """As long as all are shown, each as long as the others."""
        return len(self.files) / self.rate if len(self.files) > 1 else 0.0

    def moment(self, time: float) -> int:
        """Which file is shown, counted from 0: the same wherever it looks the same.

        From a thousandth before its time on: clients count in float32, or add up their steps.
        """
        return max(0, bisect_right(self.times, time + SLACK / self.rate) - 1)

    def lasts(self, time: float) -> float:
        """For how many seconds: until the next file comes."""
        following = self.moment(time) + 1
        return self.times[following] - time if following < len(self.times) else math.inf

    def at(self, time: float) -> Gaussians:
        """The file whose time is the newest at or before it; the first before all."""
        return self.files[self.moment(time)]


@dataclass(frozen=True, eq=False)
class Clip:
    """Gaussians that live in time.

    Attributes:
        gaussians: each at its own moment.
        motion: how they change over the clip.
        seconds: how long the clip is.
    """

    gaussians: Gaussians
    motion: Motion
    seconds: float

    @property
    def most(self) -> int:
        """How many there are, not all at the same time."""
        return len(self.gaussians)

    @property
    def degree(self) -> int:
        """Of their harmonics."""
        return self.gaussians.degree

    @cached_property
    def bounds(self) -> Box | None:
        """The box of the centres while each can be seen."""
        return reached(self.gaussians, self.motion)

    @property
    def last(self) -> float:
        """Its end, seconds."""
        return self.seconds

    @property
    def loop(self) -> float:
        """After how many seconds it begins anew where it is played: its length."""
        return self.seconds

    def moment(self, time: float) -> float:
        """Of the clip, from 0 to 1: the same wherever it looks the same."""
        return min(max(time / self.seconds, 0.0), 1.0)

    def lasts(self, time: float) -> float:
        """No time at all, until its end."""
        return 0.0 if time < self.seconds else math.inf

    def at(self, time: float) -> Gaussians:
        """Those that can be seen then."""
        return self._moved(self.moment(time))

    @cached_property
    def _moved(self) -> Callable[[float], Gaussians]:
        """Keeps what was asked for last: cameras go round a scene whose time stands still."""
        return lru_cache(maxsize=1)(partial(moved, self.gaussians, self.motion))


Part = Union[Frames, Clip]
"""One object of a scene, over time: what is the same at two times is the same object at both."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects by their ids, as they lie in their own axes."""

    parts: Mapping[str, Part]

    @property
    def time_range(self) -> tuple[float, float] | None:
        """First and last second; None where nothing changes."""
        last = max((each.last for each in self.parts.values()), default=0.0)
        return (0.0, last) if last > 0.0 else None

    @property
    def loop(self) -> float:
        """After how many seconds all begins anew where it is played, when the longest is over."""
        return max((each.loop for each in self.parts.values()), default=0.0)

    @property
    def bounds(self) -> Box | None:
        """The box of all centres, over all times, where no object is moved."""
        return enclosing(*(each.bounds for each in self.parts.values()))

    def moment(self, time: float | None) -> Hashable:
        """What is the same wherever all looks the same; cheap, where `at` may not be."""
        return tuple(each.moment(time or 0.0) for each in self.parts.values())

    def lasts(self, playing: float) -> float:
        """For how many seconds all looks the same, where it has played for some."""
        if self.time_range is None:
            return math.inf
        time = playing % self.loop
        return min(self.loop - time, *(each.lasts(time) for each in self.parts.values()))

    def at(self, time: float | None) -> dict[str, Gaussians]:
        """The objects at a second of the scene, or at the first; those after it are as at the last.

        What does not change between two times is the same object at both.
        """
        return {name: each.at(time or 0.0) for name, each in self.parts.items()}


def enclosing(*boxes: Box | None) -> Box | None:
    """The box around some; None of none."""
    some = [each for each in boxes if each]
    if not some:
        return None
    (a, b, c), (d, e, f) = (
        [choice(values) for values in zip(*corners)]
        for choice, corners in ((min, [x.min for x in some]), (max, [x.max for x in some]))
    )
    return Box((a, b, c), (d, e, f))
