"""More at a time where the machine has time for it."""

from pathlib import Path

import pytest

from tests import spare
from tests.spare import Spare

BUSY, HALF_IDLE = (90, 0, 10, 0, 0), (40, 0, 10, 45, 5)
"""Ticks of programs, nice ones, the system, idle, and while a disk was waited for."""


@pytest.fixture
def stat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the system tells, at each look."""
    monkeypatch.setattr(spare, "STAT", tmp_path / "stat")
    monkeypatch.setattr(spare, "LOOK_SECONDS", 0.0)
    return tmp_path / "stat"


def test_one_more_for_each_look_that_finds_room_and_one_fewer_for_each_that_finds_none(stat):
    def tell(ticks: list[int]) -> None:
        stat.write_text(f"cpu  {' '.join(map(str, ticks))} 0 0 0 0 0\ncpu0 1 2\n")

    ticks, found = [7] * 5, []
    tell(ticks)
    it = Spare(3)
    for each in [HALF_IDLE] * 4 + [BUSY] * 2 + [HALF_IDLE]:
        ticks = [a + b for a, b in zip(ticks, each, strict=True)]
        tell(ticks)
        found.append(it.now())
    assert found == [1, 2, 3, 3, 2, 1, 2]


def test_none_where_the_system_does_not_tell(stat):
    it = Spare(3)
    assert [it.now(), it.now()] == [0, 0]
