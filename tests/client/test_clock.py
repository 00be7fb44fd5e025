"""The server's clock, as pings tell it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_client.clock import Sample, best

DELAYS = st.tuples(st.floats(1e-6, 1.0), st.floats(1e-6, 1.0))


def sample(ahead, sent, there, back):
    """A ping that took so long on its way there, and its pong so long on its way back."""
    return Sample(sent, sent + there + ahead, sent + there + back)


@given(st.floats(-1e4, 1e4), st.floats(0, 1e4), st.lists(DELAYS, min_size=1, max_size=9))
def test_the_clock_is_estimated_to_within_half_the_shortest_round_trip(ahead, sent, delays):
    samples = [sample(ahead, sent + i, *delay) for i, delay in enumerate(delays)]
    tick = best(samples)
    shortest = min(there + back for there, back in delays)
    assert tick.error <= shortest / 2 + 1e-9
    assert abs(tick.ahead - ahead) <= tick.error + 1e-9


def test_the_examples_of_the_specification():
    first, second = Sample(12.5, 1041.375, 12.51), Sample(13.5, 1042.371, 13.502)
    for each, error in ((first, 0.005), (second, 0.001)):
        assert each.ahead == pytest.approx(1028.87)
        assert each.error == pytest.approx(error)
    assert best([first, second]) == second
