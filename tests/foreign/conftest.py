"""What the tests of both sides share."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.foreign.programs import Lacking, Program, differences, judge


@pytest.fixture
def verdict_differs(tmp_path: Path) -> Callable[[Program], list[str]]:
    """What the harness says of a program that its pins do not; skips without its toolchain."""

    def of(program: Program) -> list[str]:
        try:
            report = judge(program, tmp_path, *program.selection, profile=program.profile)
            return differences(program, report)
        except Lacking as lacking:
            pytest.skip(f"{program.name} is written in {program.language}: {lacking}")

    return of
