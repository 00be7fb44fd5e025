"""Ports that stay free while nobody listens there."""

import atexit
import collections
import contextlib
import secrets
import socket

FIRST, LAST = 10_000, 32_000
"""Below those that systems give to outgoing connections: one of these, of any program, would else
take the port of a server between its end and its next start."""
TRIES = 100
MOST_TAKEN = 200
_taken: collections.deque[socket.socket] = collections.deque()
"""Sockets of another protocol, bound to the numbers that this process has given out lately: so no
other harness on the machine gives out the same while nobody listens there."""


def listen_somewhere(host: str) -> socket.socket:
    """Listens at such a port. Raises OSError if none seems to be free."""
    for _ in range(TRIES - 1):
        with contextlib.suppress(OSError):
            return _listen_at_random(host)
    return _listen_at_random(host)


def _listen_at_random(host: str) -> socket.socket:
    port = FIRST + secrets.randbelow(LAST - FIRST)
    taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        taken.bind((host, port))
        listener = socket.create_server((host, port), backlog=16)
    except OSError:
        taken.close()
        raise
    _taken.append(taken)
    _keep(MOST_TAKEN)
    return listener


def _keep(most: int) -> None:
    while len(_taken) > most:
        _taken.popleft().close()


atexit.register(_keep, 0)


def free_port(host: str = "127.0.0.1") -> int:
    """One at which nobody listens. Raises OSError if there seems to be none."""
    with listen_somewhere(host) as listener:
        port: int = listener.getsockname()[1]
        return port
