"""Clients that nobody here wrote, judged: their verdicts are pinned, each by its requirement."""

from collections.abc import Callable

import pytest

from tests.foreign.programs import RUN_SECONDS, Program, programs

pytestmark = pytest.mark.apart

CLIENTS = [it for it in programs("client") if it.each_time]


@pytest.mark.timeout(RUN_SECONDS + 60)
@pytest.mark.parametrize("client", CLIENTS, ids=lambda client: client.name)
def test_its_verdict_is_what_its_defects_make_it(
    client: Program, verdict_differs: Callable[[Program], list[str]]
) -> None:
    assert verdict_differs(client) == []
