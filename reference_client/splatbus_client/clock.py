"""How a server's clock compares with one's own, from pings (1.1 section 9.2).

A server's clock was read some time between the sending of a ping and the arrival of its pong.
Taken for the middle of the two, it is wrong by at most half the round trip: F. Cristian,
Probabilistic clock synchronization, 1989.
"""

from collections.abc import Iterable
from typing import NamedTuple


class Sample(NamedTuple):
    """One ping and its pong.

    Attributes:
        sent: seconds on the client's clock, `time.perf_counter()`, when the ping was.
        server_time: seconds on the server's clock, that of `rendered_at`.
        received: seconds on the client's clock, when the pong was.
    """

    sent: float
    server_time: float
    received: float

    @property
    def round_trip(self) -> float:
        """Seconds from the ping to the pong."""
        return self.received - self.sent

    @property
    def ahead(self) -> float:
        """By how many seconds the server's clock is ahead of the client's, give or take `error`."""
        return self.server_time - (self.sent + self.received) / 2

    @property
    def error(self) -> float:
        """By how much `ahead` may be wrong at most, seconds."""
        return self.round_trip / 2

    def here(self, server_time: float) -> float:
        """Return when, on the client's clock, the server's showed that; `rendered_at`, say."""
        return server_time - self.ahead


def best(samples: Iterable[Sample]) -> Sample:
    """Return the sample that tells most: the one with the shortest round trip.

    Clocks drift: give it samples of the last minute, say, rather than of the last day.

    Raises:
        ValueError: there is none.
    """
    return min(samples, key=lambda sample: sample.round_trip)
