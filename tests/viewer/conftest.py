"""What the viewer's tests share."""

import pytest

from tests.peers.clients import memory, server, session

__all__ = ["memory", "server", "session"]


@pytest.fixture
def where(server, monkeypatch):
    """The fake server is where the command looks for one."""
    monkeypatch.setenv("SPLATBUS_IPC_PORT", str(server.ipc_port))
    monkeypatch.setenv("SPLATBUS_MSG_PORT", str(server.message_port))
