"""A client that asks and reads no reply, until some wait in the server."""

import time
from dataclasses import dataclass, field

from splatbus_schemas import LIMITS

from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee import os_evidence
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import HEADER, packet
from splatbus_conformance.wire.sockets import TICK_SECONDS, Connection

PORTION = 1 << 14
"""Bytes of replies that are asked for at a time."""
ENOUGH = PORTION
MOST_UNSHOWN = LIMITS["max_unsent_bytes"] - 2 * PORTION
"""Of which a server may keep all (LIM-2), where the system does not show what it keeps."""
ON_ITS_WAY = 1 << 13
"""Bytes that may count at both ends for a moment: by less, what was written has not grown."""
IDLE_TICKS = 3
"""In which nothing moves: what is not answered yet does not wait yet."""
MOST_TICKS = 500
PATIENCE_SECONDS = LIMITS["stalled_reader_seconds"] / 2
"""For which no server ends a client of which TCP takes nothing (LIM-2)."""


@dataclass
class Stalled:
    """A connection on which nothing is read for now."""

    trial: ServerTrial
    connection: Connection
    request: bytes
    reply: int
    """Bytes of a reply to it."""
    sent: int = 0
    """Bytes of requests that went out and are not answered yet; the last may be incomplete."""
    waits: int | None = 0
    """Bytes of replies that waited in the server, which may keep more; None if it is not shown."""
    owed: int | None = 0
    """Bytes of replies that the server had not given to TCP, also of what it has not taken."""
    moved: float = field(default_factory=time.monotonic)
    """When TCP last took something of the replies, or earlier."""
    _looked: float = field(default_factory=time.monotonic)
    _written: int = 0
    """Bytes of replies that were seen in the systems of both ends when they had grown."""

    @property
    def asked(self) -> int:
        """Requests that went out whole."""
        return self.sent // len(self.request)

    @property
    def extent(self) -> str:
        """How many requests it took until replies waited in the server, if they did."""
        if self.waits is None:
            return f"{self.asked} requests went out; the system does not show what waits"
        return f"after {self.asked} requests {max(0, self.waits)} bytes of replies waited in it"

    def look(self) -> None:
        """See what waits once nothing has moved for a while."""
        before, idle = self._shown(), 0
        for _ in range(MOST_TICKS):
            if before is None or idle == IDLE_TICKS:
                break
            _look_away(self.trial)
            now = self._shown()
            before, idle = now, idle + 1 if now == before else 0
        self.waits = before and before[0] // len(self.request) * self.reply - before[1]
        self.owed = before and self.asked * self.reply - before[1]

    def _shown(self) -> tuple[int, int] | None:
        """Bytes of requests that the server has taken from TCP, and of replies given to it."""
        mine, theirs = self.connection.port, self.connection.testee_port
        server, client = os_evidence.queues(theirs, mine), os_evidence.queues(mine, theirs)
        if server is None or client is None:
            return None
        written = server.unsent + client.unread
        if written > self._written + ON_ITS_WAY:
            self.moved, self._written = self._looked, written
        self._looked = time.monotonic()
        return self.sent - client.unsent - server.unread, written

    def pour(self, most: int) -> bool:
        """Send so many bytes of requests; whether TCP took them all, while nothing is read."""
        goal, idle = self.sent + most, 0
        data = self.request * (most // len(self.request) + 2)
        while self.sent < goal and idle < IDLE_TICKS:
            begun = self.sent % len(self.request)
            taken = self.connection.push(data[begun : begun + goal - self.sent], noted=True)
            if taken is None:
                break
            self.sent, idle = self.sent + taken, 0 if taken else idle + 1
            if not taken:
                _look_away(self.trial)
        return self.sent == goal


def stalled(trial: ServerTrial, asks: Json) -> Stalled:
    """Ask for this as often as it takes for replies to wait."""
    connection = trial.dial_narrowly("msg")
    trial.expect(trial.ask(connection, asks), "no-reply", "no reply on the message channel")
    reply = HEADER + len(connection.messages[-1].packet.payload)
    stands = Stalled(trial, connection, packet(encode(asks)), reply)
    while stands.pour(PORTION // reply * len(stands.request)):
        stands.look()
        if stands.waits is None and stands.asked * reply > MOST_UNSHOWN:
            break
        if stands.waits is not None and stands.waits >= ENOUGH:
            break
    return stands


def _look_away(trial: ServerTrial) -> None:
    with trial.peer.waiting():
        time.sleep(TICK_SECONDS)
