"""Sessions of the reference pair, and that a session is replayed by its seed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.simulation.run import ROOT, play_all
from tests.simulation.session import play

pytestmark = pytest.mark.apart

PARTS, SESSIONS = 3, 100
OFTEN = 5
"""What is looked at less often than that in a part does not say much."""


@pytest.mark.parametrize("part", range(PARTS))
def test_everyone_is_served_whatever_goes_wrong(part: int) -> None:
    played = play_all(part * SESSIONS, SESSIONS)
    assert not played.broken
    seldom = {name: n for name, n in played.looked.items() if n < OFTEN}
    assert len(played.looked) - len(seldom) >= 40, seldom


@pytest.mark.parametrize("seed", range(3))
def test_a_session_is_replayed_by_its_seed(seed: int) -> None:
    """In another process, whose sets have another order."""
    here: list[str] = []
    play(seed, here.append)
    command = (sys.executable, "-m", "tests.simulation", "--seed", str(seed), "-v")
    environment = {**os.environ, "PYTHONHASHSEED": str(seed + 1)}
    told = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert told.stdout.splitlines()[:-1] == here
    assert told.returncode == 0
