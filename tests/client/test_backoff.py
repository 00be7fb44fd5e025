"""The schedule of attempts to connect [CHN-21, CHN-22]."""

from itertools import islice, pairwise

from splatbus_client.backoff import delays
from splatbus_schemas import LIMITS


def test_delays_keep_the_limits_with_room_for_a_clock_that_is_not_ours():
    first = list(islice(delays(), 20))
    assert min(first) > LIMITS["reconnect_min_seconds"]
    assert max(first) < LIMITS["reconnect_max_seconds"]


def test_delays_double_until_the_longest():
    first = list(islice(delays(), 20))
    longest = first[-1]
    assert all(b == min(2 * a, longest) for a, b in pairwise(first))
    assert first[0] < 0.2
    assert first[-2] == longest
