"""Says after the tests how far off the worst case of each accuracy budget was, and which it was."""

from collections.abc import Iterator
from typing import Any

import pytest

from tests.wire import stress

WORST = "worst error"


@pytest.fixture(autouse=True)
def _worst_errors(request: pytest.FixtureRequest) -> Iterator[None]:
    stress.worst = stress.Measurements()
    yield
    request.node.user_properties += [(WORST, str(it)) for it in stress.worst if it.worst]


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Also where the tests ran in other processes."""
    reports = [it for found in terminalreporter.stats.values() for it in found]
    told = {
        text: None
        for report in reports
        for name, text in getattr(report, "user_properties", ())
        if name == WORST
    }
    if told:
        terminalreporter.section("worst errors found")
        for text in told:
            terminalreporter.write_line(text)
