"""One who never reads asks on at the pace of a server that is kept from running for a while."""

from types import SimpleNamespace

import pytest
from splatbus_conformance.trials.moves import bad_neighbours


@pytest.mark.parametrize(
    ("takes", "asks_on"),
    [([*[True] * 10, *[False] * 20] * 2, True), ([True, *[False] * 10_000], False)],
)
def test_who_never_reads_stops_only_where_its_server_takes_nothing_more(
    takes: list[bool], asks_on: bool
) -> None:
    rested, taken = list[float](), list[int]()

    def push(data: bytes) -> int:
        taken.append(len(data) if not takes or takes.pop(0) else 0)
        return taken[-1]

    trial = SimpleNamespace(rest=rested.append, peer=SimpleNamespace(clock=lambda: sum(rested)))
    pipe = SimpleNamespace(push=push, stop_reading=lambda: None)
    bad_neighbours._never_reads(trial, pipe)  # type: ignore[arg-type]
    enough = bad_neighbours.UNREAD * len(bad_neighbours.REQUEST)
    assert (sum(taken) >= enough) is asks_on
    assert asks_on or sum(rested) >= bad_neighbours.STUCK_SECONDS
