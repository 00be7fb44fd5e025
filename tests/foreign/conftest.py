"""What the tests of both sides share."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.foreign.programs import Lacking, Program, differences, judge

LONG = (
    "unity_like",
    "slow_viewer",
    "engine",
    "slow_start",
    "two_each",
    "deployed",
    "blobs",
    "token",
    "reluctant",
    "on_demand",
    "cloud",
    "odd_spelling",
)
"""Programs whose judgement takes longest; the others fill the gaps."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long ones first, for what is begun last is waited for alone."""
    names = [f"[{name}]" for name in LONG]

    def rank(item: pytest.Item) -> int:
        judged = "its_verdict" in item.name
        places = [place for place, name in enumerate(names) if item.name.endswith(name)]
        return next(iter(places), len(names)) if judged else len(names) + 1

    items.sort(key=rank)


@pytest.fixture
def verdict_differs(tmp_path: Path) -> Callable[[Program], list[str]]:
    """What the harness says of a program that its pins do not; skips without its toolchain."""

    def of(program: Program) -> list[str]:
        try:
            return differences(program, judge(program, tmp_path))
        except Lacking as lacking:
            pytest.skip(f"{program.name} is written in {program.language}: {lacking}")

    return of
