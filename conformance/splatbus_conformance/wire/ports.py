"""Ports that stay free while nobody listens there."""

import contextlib
import secrets
import socket

FIRST, LAST = 10_000, 32_000
"""Below those that systems give to outgoing connections: one of these, of any program, would else
take the port of a server between its end and its next start."""
TRIES = 100


def listen_somewhere(host: str) -> socket.socket:
    """Listens at such a port. Raises OSError if none seems to be free."""
    for _ in range(TRIES - 1):
        with contextlib.suppress(OSError):
            return _listen_at_random(host)
    return _listen_at_random(host)


def _listen_at_random(host: str) -> socket.socket:
    return socket.create_server((host, FIRST + secrets.randbelow(LAST - FIRST)), backlog=16)


def free_port(host: str = "127.0.0.1") -> int:
    """One at which nobody listens. Raises OSError if there seems to be none."""
    with listen_somewhere(host) as listener:
        port: int = listener.getsockname()[1]
        return port
