from __future__ import annotations

import math

from splatbus_server.share import BURST_SECONDS, REST, SHORTEST_SECONDS, TURN_SECONDS, Share


def test_who_takes_little_never_rests() -> None:
    share = Share()
    for turn in range(1000):
        share.charge(TURN_SECONDS / 10, 0, turn * TURN_SECONDS * REST / 10)
        assert not share.is_resting


def test_who_takes_all_it_can_has_its_share() -> None:
    share, now, worked = Share(), 0.0, 0.0
    while now < 10.0:
        share.charge(TURN_SECONDS, 0, now)
        worked += TURN_SECONDS
        now += TURN_SECONDS
        if share.is_resting:
            assert share.rests_until > now
            now = share.rests_until
            share.expire(now)
    assert 0.9 / REST < worked / now < 1.1 / REST


def test_small_pieces_are_added_up() -> None:
    """Otherwise whoever sends them faster than they are read would never rest."""
    share = Share()
    for piece in range(50):
        share.charge(TURN_SECONDS / 10, 0, piece * TURN_SECONDS)
    assert share.is_resting


def test_the_more_rest_the_longer_each_does() -> None:
    alone, among_three = Share(), Share()
    for share, resting in ((alone, 0), (among_three, 2)):
        share.charge(3 * BURST_SECONDS, resting, 1.0)
    assert math.isclose(
        among_three.rests_until - 1.0 - SHORTEST_SECONDS,
        3 * (alone.rests_until - 1.0 - SHORTEST_SECONDS),
    )
    alone.expire(alone.rests_until - 1e-6)
    assert alone.is_resting


def test_work_at_once_is_no_more_for_the_rest_of_others() -> None:
    """Else who behaves would pay for those who do not, whenever a turn of its own takes longer."""
    share = Share()
    share.charge(0.9 * BURST_SECONDS, 7, 1.0)
    share.charge(0.0, 0, 1.0)
    assert not share.is_resting


def test_who_asks_one_thing_after_the_other_never_waits_long() -> None:
    share, now, rests = Share(), 0.0, []
    for _ in range(10_000):
        now += 30e-6
        share.charge(30e-6, 0, now)
        if share.is_resting:
            rests.append(share.rests_until - now)
            now = share.rests_until
            share.expire(now)
    assert 0.0 < max(rests) < 0.001


def test_who_rests_after_a_long_packet_slows_nobody_else_down() -> None:
    share = Share()
    share.rest(5.0)
    share.charge(BURST_SECONDS / 2, 0, 1.0)
    assert share.is_resting
    assert share.owes_until < 1.0
    share.charge(2 * BURST_SECONDS, 0, 1.0)
    assert 1.0 < share.owes_until < share.rests_until == 5.0
