"""Whether the simulation sees what is broken."""

from __future__ import annotations

import pytest

from tests.simulation.breakages import BREAKAGES, broken
from tests.simulation.machine.world import BrokenError
from tests.simulation.session import play

MOST_SEEDS = 400
"""The first that finds it is named with the breakage; others, after what the pair does changed."""


@pytest.mark.parametrize("name", BREAKAGES)
def test_a_breakage_is_found(name: str) -> None:
    breakage = BREAKAGES[name]
    with broken(breakage):
        for seed in (breakage.seed, *range(MOST_SEEDS)):
            try:
                play(seed)
            except BrokenError:
                return
    pytest.fail(f"{MOST_SEEDS} sessions broke nothing")
