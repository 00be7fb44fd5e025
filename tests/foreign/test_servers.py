"""Servers that nobody here wrote, judged: their verdicts are pinned, each by its requirement."""

from collections.abc import Callable

import pytest

from tests.foreign.programs import RUN_SECONDS, Program, programs

pytestmark = pytest.mark.apart

SERVERS = [it for it in programs("server") if it.each_time]


@pytest.mark.timeout(RUN_SECONDS + 60)
@pytest.mark.parametrize("server", SERVERS, ids=lambda server: server.name)
def test_its_verdict_is_what_its_defects_make_it(
    server: Program, verdict_differs: Callable[[Program], list[str]]
) -> None:
    assert verdict_differs(server) == []
