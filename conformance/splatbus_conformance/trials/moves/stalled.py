"""A client that asks and reads no reply, until some wait in the server."""

import time
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee import os_evidence
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import HEADER, packet
from splatbus_conformance.wire.sockets import TICK_SECONDS, Connection

PORTION = 1 << 16
"""Bytes of replies that are asked for at a time."""
ENOUGH = 2 * PORTION
MOST_UNSHOWN = LIMITS["max_unsent_bytes"] - 2 * PORTION
"""Of which a server may keep all (LIM-2), where the system does not show what it keeps."""
IDLE_TICKS, SETTLED_TICKS = 3, 40
"""In which nothing moves: for a look, and before it is believed."""
MOST_TICKS = 500


class Stalled(NamedTuple):
    """A connection on which nothing is read for now."""

    connection: Connection
    heard: int
    """Messages that had come before."""
    request: bytes
    asked: int
    """Requests that went out whole, which are not answered yet."""
    waits: int | None
    """Bytes of replies that wait in the server, which may keep more; None if it is not shown."""

    @property
    def extent(self) -> str:
        """How many requests it took until replies waited in the server, if they did."""
        if self.waits is None:
            return f"{self.asked} requests went out; the system does not show what waits"
        return f"after {self.asked} requests {max(0, self.waits)} bytes of replies waited in it"


def stalled(trial: ServerTrial, requests: list[Json]) -> Stalled:
    """Ask for the longest of the replies to these, as often as it takes for some to wait."""
    connection = trial.dial_narrowly("msg")
    trial.expect(trial.answers(connection), "no-reply", "no reply on the message channel")
    trial.ask_all(connection, requests)
    lengths = [HEADER + len(it.payload) for it in connection.packets[-len(requests) :]]
    heard, longest = len(trial.viewer.with_(connection).heard), max(lengths)
    request = packet(encode(requests[lengths.index(longest)]))
    asked, waits = 0, None
    while waits is None or waits < ENOUGH:
        portion = PORTION // longest
        asked += (taken := _pour(trial, connection, portion * request, len(request)))
        for ticks in (IDLE_TICKS, SETTLED_TICKS):  # what is not answered yet does not wait yet
            kept = _held(trial, connection, ticks)
            waits = None if kept is None else asked * longest - kept
            if waits is None or waits < ENOUGH:
                break
        if taken < portion or (kept is None and asked * longest > MOST_UNSHOWN):
            break
    return Stalled(connection, heard, request, asked, waits)


def _pour(trial: ServerTrial, connection: Connection, data: bytes, length: int) -> int:
    """Send what TCP takes of requests of this length while nothing is read, and the rest of the
    last; how many that were.
    """
    sent, idle = 0, 0
    while sent < len(data) and (idle < IDLE_TICKS or sent % length):
        taken = connection.push(data[sent:], noted=True)
        if taken is None:
            break
        sent, idle = sent + taken, 0 if taken else idle + 1
        if idle >= IDLE_TICKS:
            data = data[: sent - sent % length + length]
            trial.rest(TICK_SECONDS)
        elif idle:
            _look_away(trial)
    return sent // length


def _held(trial: ServerTrial, connection: Connection, ticks: int) -> int | None:
    """Bytes of replies in the systems of both ends, once nothing has moved for so many ticks."""
    mine, theirs = connection.port, connection.testee_port
    before, idle = None, 0
    for _ in range(MOST_TICKS):
        if idle >= ticks:
            break
        _look_away(trial)
        now = os_evidence.queues(theirs, mine), os_evidence.queues(mine, theirs)
        before, idle = now, idle + 1 if now == before else 0
        if None in now:
            return None
    server, client = before or (None, None)
    return server.unsent + client.unread if server and client else None


def _look_away(trial: ServerTrial) -> None:
    with trial.peer.waiting():
        time.sleep(TICK_SECONDS)
