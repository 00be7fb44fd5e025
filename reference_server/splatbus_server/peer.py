"""A connection and its socket."""

from __future__ import annotations

import math
import selectors
import socket
from collections import Counter
from dataclasses import dataclass, field

from splatbus_server.connection import Connection


@dataclass(eq=False)
class Peer:
    """A connection and its socket.

    Attributes:
        name: for the log.
        awaits: what the selector looks out for; nothing while it is not registered there.
        noted: how often was refused what, by the error's code.
        heard_from: when what it sends is looked at again, where a turn was too short for it;
            infinity elsewhere.
        waits: what it sends is not looked at for the time being.
        is_ending: the log says already why the connection ends.
        is_shut: the client has been told that nothing more will come.
    """

    name: str
    socket: socket.socket
    connection: Connection
    awaits: int = selectors.EVENT_READ
    noted: Counter[str] = field(default_factory=Counter)
    heard_from: float = math.inf
    waits: bool = False
    is_shut: bool = False
    is_ending: bool = False
