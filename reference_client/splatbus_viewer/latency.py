"""How long a pose takes to become an image, from the tags that come back [CAM-2]."""

from __future__ import annotations

import statistics
from collections import OrderedDict, deque
from collections.abc import Sequence

from splatbus_wire.messages import FrameCamera
from splatbus_wire.poses import Pose

_WAITING = 256
_KEPT = 10_000


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
