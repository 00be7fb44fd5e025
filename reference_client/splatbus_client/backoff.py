"""When to try to connect again: soon, then less and less often [CHN-21, CHN-22]."""

from collections.abc import Iterator

from splatbus_schemas import LIMITS

# A server measures on its own clock, and no thread wakes at the very moment that it asked for.
SHORTEST: float = 1.25 * LIMITS["reconnect_min_seconds"]
LONGEST: float = 0.4 * LIMITS["reconnect_max_seconds"]


def delays() -> Iterator[float]:
    """Yield the seconds to wait after each failure in a row: doubling, then constant, for ever.

    Whoever has succeeded drops the iterator and takes a new one.
    """
    delay = SHORTEST
    while True:
        yield delay
        delay = min(2 * delay, LONGEST)
