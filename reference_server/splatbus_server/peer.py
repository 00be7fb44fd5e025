"""A connection and its socket."""

from __future__ import annotations

import select
import selectors
import socket
import sys
from collections import Counter
from dataclasses import dataclass, field

from splatbus_server.connection import Connection


def has_hung_up(connection: socket.socket) -> bool:
    """Whether the other side has closed it, though not all that it sent has been read.

    Not known on every system; False where it is not.
    """
    if sys.platform != "linux":
        return False
    watch = select.poll()
    watch.register(connection, select.POLLRDHUP)
    return bool(watch.poll(0))


@dataclass(eq=False)
class Peer:
    """A connection and its socket.

    Attributes:
        name: for the log.
        awaits: what the selector looks out for; nothing while it is not registered there.
        noted: how often was refused what, by the error's code.
        is_behind: it has sent more than was handled in its last turn.
        is_ending: the log says already why the connection ends.
        is_shut: the client has been told that nothing more will come.
    """

    name: str
    socket: socket.socket
    connection: Connection
    awaits: int = selectors.EVENT_READ
    noted: Counter[str] = field(default_factory=Counter)
    is_behind: bool = False
    is_shut: bool = False
    is_ending: bool = False

    @property
    def waits(self) -> bool:
        """Whether what it sends is not looked at for the time being."""
        return self.is_behind or not self.connection.is_ready
