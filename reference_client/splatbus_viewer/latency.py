"""How long a pose takes to become an image, from the tags that come back [CAM-2]."""

from __future__ import annotations

import math
import statistics
from bisect import bisect_right
from collections import Counter, OrderedDict, deque
from collections.abc import Sequence

from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import Pose

from splatbus_viewer.terminal import bar

_WAITING = 256
_KEPT = 10_000
_STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
_BAR_LETTERS = 40


class Latencies:
    """Waits of poses for their images.

    Attributes:
        seconds: the last ten thousand, in order.
    """

    def __init__(self) -> None:
        self.seconds: deque[float] = deque(maxlen=_KEPT)
        self._asked: OrderedDict[str | Pose, float] = OrderedDict()

    def asked_for(self, view: str | Pose, now: float) -> None:
        """Remember when a view was first asked for: by its tag, or by its pose where it has none.

        A server of 1.0 gives no tag back. An image with the same pose may be older, then.
        """
        self._asked.setdefault(view, now)
        if len(self._asked) > _WAITING:
            self._asked.popitem(last=False)

    def shown(self, camera: FrameCamera, now: float) -> None:
        """Take note that an image was read; only the first that shows a view ends its wait.

        Views come back in the order in which they were asked for: those before were overtaken.
        """
        view = camera.pose if camera.tag is None else camera.tag
        if view in self._asked:
            while (first := self._asked.popitem(last=False))[0] != view:
                pass
            self.seconds.append(now - first[1])


def percentiles(seconds: Sequence[float]) -> tuple[float, float]:
    """Return the median and the 99th percentile of at least one number."""
    if len(seconds) == 1:
        return seconds[0], seconds[0]
    cuts = statistics.quantiles(seconds, n=100, method="inclusive")
    return cuts[49], cuts[98]


def histogram(seconds: Sequence[float]) -> list[str]:
    """Return lines that show how many waits were how long; none for none."""
    if not seconds:
        return []
    edges = _edges(1e3 * min(seconds), 1e3 * max(seconds))
    counts = Counter(bisect_right(edges, 1e3 * wait) - 1 for wait in seconds)
    most = max(counts.values())
    median, late = percentiles(seconds)
    lines = [
        f"latency from pose to image, {len(seconds)} images:"
        f" median {1e3 * median:.1f} ms, 99th percentile {1e3 * late:.1f} ms"
    ]
    for index, (least, end) in enumerate(zip(edges, edges[1:])):
        share = counts[index] / most
        row = f"{f'{least:g} to {end:g} ms':>16} {bar(share, _BAR_LETTERS)}".rstrip()
        lines.append(f"{row} {counts[index]}")
    return lines


def _edges(least: float, most: float) -> list[float]:
    """0 or round numbers, about √2 apart; the first is at most `least`, the last above `most`."""
    decade = math.floor(math.log10(max(least, 1e-3)))
    rounds = [0.0]
    while rounds[-1] <= most:
        rounds += [float(f"{step * 10.0**decade:.3g}") for step in _STEPS]
        decade += 1
    return rounds[bisect_right(rounds, least) - 1 : bisect_right(rounds, most) + 1]
