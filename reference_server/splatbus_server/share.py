"""What part of the I/O thread's time one client may have: the others' is not for it to take.

The thread and the renderer's share one interpreter, so its time is the renderer's as well.
"""

from __future__ import annotations

import math
import sys
import time

TURN_SECONDS = 0.0005
"""Of work for one connection, after which the others have their turn; one packet is always read."""
REST = 20.0
"""Times as long a client rests as it had the thread work, and again so long for each other client
that rests: all that send as much as they can have a twentieth of the time together."""

clock = time.perf_counter if sys.platform == "win32" else time.thread_time
"""Seconds that this thread has worked, without what it waited for the renderer's; on Windows, where
that is counted in steps of 16 ms, seconds."""


class Share:
    """Of one client, or of all that knock.

    Attributes:
        rests_until: when what it sends is looked at again; infinity while it is.
    """

    def __init__(self) -> None:
        self.rests_until = math.inf
        self._paid_at = -math.inf

    @property
    def is_resting(self) -> bool:
        """Whether it has had more than its share."""
        return self.rests_until < math.inf

    def charge(self, worked: float, resting: int, now: float) -> None:
        """Takes it that the thread worked so long for it, in seconds.

        Args:
            worked: by `clock`.
            resting: how many others do.
            now: the moment.
        """
        self._paid_at = max(self._paid_at, now) + REST * (1 + resting) * worked
        if self._paid_at > now + REST * TURN_SECONDS:
            self.rests_until = self._paid_at

    def expire(self, now: float) -> None:
        """Ends a rest that is over."""
        if now >= self.rests_until:
            self.rests_until = math.inf
