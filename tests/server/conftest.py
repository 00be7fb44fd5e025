from __future__ import annotations

import math
from collections.abc import Iterator

import pytest
import splatbus_server
from splatbus_server import logs

from tests.server.stage import Stage

SIZE = (16, 8)


@pytest.fixture
def bus() -> Iterator[splatbus_server.Bus]:
    """A server on ports of its own."""
    with splatbus_server.serve(*SIZE, ipc_port=0, message_port=0) as serving:
        yield serving


@pytest.fixture(autouse=True)
def whole_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many lines of a kind there are."""
    monkeypatch.setattr(logs, "LINES_A_SECOND", math.inf)


@pytest.fixture
def stage() -> Stage:
    """A session without sockets."""
    return Stage()
