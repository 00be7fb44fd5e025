"""What part of the I/O thread's time one client may have: the others' is not for it to take.

The thread and the renderer's share one interpreter, so its time is the renderer's as well.
"""

from __future__ import annotations

import math
import sys
import time

TURN_SECONDS = 0.0005
"""Of work for one connection, after which the others have their turn; one packet is always read."""
BURST_SECONDS = 0.001
"""Of work that one may have at once: it answers many questions, and the collector of garbage may
come in the turn of one who behaves."""
REST = 20.0
"""Times as long a client rests as it had the thread work beyond that, and again so long for each
other that does: all that send as much as they can have a twentieth of the time together."""
SHORTEST_SECONDS = 0.0003
"""Of a rest: who asks one thing after the other waits often and shortly, not long at times."""

clock = time.perf_counter if sys.platform == "win32" else time.thread_time
"""Seconds that this thread has worked, without what it waited for the renderer's; on Windows, where
that is counted in steps of 16 ms, seconds."""


class Share:
    """Of one client, or of all that knock.

    Attributes:
        rests_until: when what it sends is looked at again; infinity while it is.
        owes_until: until when it rests for what it had, or had last; not for what it sent, which
            slows nobody else down.
    """

    def __init__(self) -> None:
        self.rests_until = math.inf
        self.owes_until = -math.inf
        self._worked = 0.0  # seconds that no rest has paid for
        self._at = -math.inf

    @property
    def is_resting(self) -> bool:
        """Whether what it sends is not looked at."""
        return self.rests_until < math.inf

    def charge(self, worked: float, owing: int, now: float) -> None:
        """Takes it that the thread worked so long for it, in seconds.

        Args:
            worked: by `clock`.
            owing: how many others have had more than their share.
            now: the moment.
        """
        slowness = REST * (1 + owing)
        self._worked = max(0.0, self._worked - (now - self._at) / slowness) + worked
        self._at = now
        if self._worked > BURST_SECONDS:
            self.owes_until = now + (self._worked - BURST_SECONDS) * slowness + SHORTEST_SECONDS
            self.rest(self.owes_until)

    def rest(self, until: float) -> None:
        """Rests until then, or for longer where it does already."""
        self.rests_until = max(until, self.rests_until) if self.is_resting else until

    def expire(self, now: float) -> None:
        """Ends a rest that is over."""
        if now >= self.rests_until:
            self.rests_until = math.inf
