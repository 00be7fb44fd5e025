"""The server's clock as pings show it, against the clock that both in truth share."""

from __future__ import annotations

from splatbus_client.clock import best

from tests.pair.painting import painter
from tests.pair.rig import MOST_SECONDS, serving


def test_the_offset_is_known_to_within_the_round_trip() -> None:
    """Both are in one process here and read one clock: the truth is an offset of 0."""
    with serving(painter()) as (_, tap), tap.session() as session:
        samples = [session.ping(MOST_SECONDS) for _ in range(20)]
        for sample in samples:
            assert abs(sample.ahead) <= sample.error
            assert sample.sent <= sample.server_time <= sample.received
        chosen = best(samples)
        assert chosen.round_trip == min(s.round_trip for s in samples)
        with session.next_frame(MOST_SECONDS) as frame:
            age = session.ping(MOST_SECONDS).received + chosen.ahead - frame.rendered_at
            assert age >= -chosen.error
    tap.assert_conforming()
