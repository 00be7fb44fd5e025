"""Ports that stay free while nobody listens there."""

import secrets
import socket

FIRST, LAST = 10_000, 32_000
"""Below those that systems give to outgoing connections: one of these, of any program, would else
take the port of a server between its end and its next start."""
TRIES = 100


def free_port(host: str = "127.0.0.1") -> int:
    """One at which nobody listens. Raises OSError if there seems to be none."""
    for tries_left in reversed(range(TRIES)):
        port = FIRST + secrets.randbelow(LAST - FIRST)
        try:
            socket.create_server((host, port)).close()
        except OSError:
            if not tries_left:
                raise
        else:
            return port
    raise AssertionError("it tries once at least")
