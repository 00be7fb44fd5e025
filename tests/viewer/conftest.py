"""What the viewer's tests share."""

from tests.peers.clients import memory, server, session

__all__ = ["memory", "server", "session"]
