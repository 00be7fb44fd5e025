"""A trial of a client, as far as its connections go: how it comes back, and whether it means it.

Some look first, and close what they looked with; some pause longer each time.
"""

from collections.abc import Callable
from typing import Any, ClassVar

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.images.painted import Painting
from splatbus_conformance.plan import Side
from splatbus_conformance.trials import memory_pace
from splatbus_conformance.trials.scripted_server import ScriptedServer, ServedConnection
from splatbus_conformance.trials.testee.client_probe import ClientFacts
from splatbus_conformance.trials.trial import EFFECT_SECONDS, Stand, Trial
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

PROBES = 2
"""Connections in a row that a testee may end for reasons of its own before one that it keeps."""
AGAIN = 2.0
"""How much longer than its longest pause so far its next may be."""
LATE_SECONDS = 1.0
MOST_RETURN_SECONDS = 40.0
MISSED_SECONDS = 3.0
"""After which it is said that a testee is waited for."""


class ReturningTrial(Trial):
    """What a check of a client has in hand of the role of a server, and of its connections."""

    side: ClassVar[Side] = "client"

    def __init__(
        self, requirement: Requirement, stand: Stand, role: ScriptedServer, facts: ClientFacts
    ) -> None:
        super().__init__(requirement, stand)
        self._calls_before = len(self.stand_in.calls()) if self.stand_in else 0
        self.role = role
        self.facts = facts
        self.lent: dict[int, Painting] = {}
        """The image of each number that was lent to be read."""
        self._used: set[Connection] = set()
        self.peer.on_open = role.on_open
        self.peer.on_message = role.on_message

    def with_(self, connection: Connection) -> ServedConnection:
        """What was said on a connection."""
        return self.role.with_(connection)

    def next_connection(self, channel: Channel, seconds: float | None = None) -> Connection | None:
        """Close those of this channel that were used; a new one, if it comes in time.

        None of a testee that has hung, died or exited: unlike `connection`, this starts no other.
        """
        for used in self._used:
            if used.channel == channel:
                used.close()
        seconds = self.return_seconds() if seconds is None else seconds
        for part in (min(seconds, MISSED_SECONDS), seconds - MISSED_SECONDS):
            self.peer.until(lambda: self._unused(channel) or self.testee.ended(), part)
            if part == MISSED_SECONDS and not self._unused(channel):
                self.testee.missed(channel)
        found = self._unused(channel)
        if found is not None:
            self._used.add(found)
            self.facts.was_away(self.peer, found, self.testee.started)
        return found

    def _unused(self, channel: Channel) -> Connection | None:
        """One that is there; or was, of a testee that has ended over what it was sent on it before
        anybody looked.
        """
        on_it = (c for c in self.peer.connections if c.channel == channel and c.open)
        unused = [c for c in on_it if c not in self._used]
        there = [c for c in unused if not c.ended]
        if not there and self.testee.ended() and not self.facts.leaves:
            there = [c for c in unused if c.messages]
        return next(iter(there), None)

    def goes_on_with(self, connection: Connection) -> bool:
        """Whether the testee says on this connection what it says on one that it keeps.

        A client that speaks 1.0 has nothing to say on the IPC channel.
        """
        if connection.channel == "msg":
            self.wait(lambda: connection.messages or connection.ended)
            return bool(connection.messages)
        if not self.facts.speaks_1_1("ipc"):
            return True
        role = self.role
        role.welcome_whoever_waits(connection)
        dealings = role.with_(connection)

        def greeted() -> bool:
            return bool(dealings.welcome or (dealings.hello and not role.greets))

        self.wait(lambda: greeted() or connection.ended)
        if not (greeted() and dealings.welcome and self.facts.opens):
            return greeted()
        if not role.offers_memory:
            role.offer(connection)
        return self.opens(connection)

    def tries_to_go_on(self, channel: Channel) -> tuple[int, bool]:
        """How many connections it makes until it goes on with one, and whether it comes to that."""
        for tries in range(1, 2 + PROBES):
            connection = self.next_connection(channel)
            if connection is None:
                return tries, False
            if self.goes_on_with(connection):
                self.controls += 1
                return tries, True
            if not connection.ended:
                return tries, False
        return tries, False

    def past_probes(self, channel: Channel, seconds: float) -> Connection | None:
        """A new connection; of a testee that has just been started, one that it means to keep."""
        found = self.next_connection(channel, seconds)
        probes = self.facts.probes.get(channel, 0)
        while found is not None and self._since_start(channel) <= probes:
            self._answer_until_it_ends(found)
            found = self.next_connection(channel, seconds)
        return found

    def _answer_until_it_ends(self, probe: Connection) -> None:
        """Whatever the check withholds from the testee's other connections."""
        heard, answered = self.with_(probe).heard, 0

        def ends() -> bool:
            nonlocal answered
            for request in heard[answered:] if not self.role.replies else ():
                self.role.reply(probe, request)
            answered = len(heard)
            return probe.ended is not None

        self.wait(ends)

    def _since_start(self, channel: Channel) -> int:
        """How many connections the testee has made on a channel since it was started."""
        born = self.testee.started
        on_it = [c for c in self.peer.connections if c.channel == channel and c.opened >= born]
        return len(on_it) if born else 1 + self.facts.probes.get(channel, 0)

    def return_seconds(self) -> float:
        """How long a testee is waited for that may pause longer each time (CHN-22 is no MUST)."""
        next_pause = AGAIN * self.facts.away_seconds + LATE_SECONDS
        return max(self.patience, min(next_pause, MOST_RETURN_SECONDS))

    def wait(self, condition: Callable[[], Any], seconds: float | None = None) -> bool:
        """As of every trial; without a limit of its own, as long as this testee's pace asks for."""
        return super().wait(condition, self.facts.effect_seconds if seconds is None else seconds)

    def uses(self, condition: Callable[[], Any], seconds: float = EFFECT_SECONDS) -> bool:
        """Wait, at this testee's pace, until memory is opened or read; whether it is."""
        return self.wait(condition, memory_pace.patience(self.facts.memory_seconds, seconds))

    def opens(self, connection: Connection, seconds: float = EFFECT_SECONDS) -> bool:
        """Whether the testee opens the memory that was offered last on this connection."""
        dealings = self.with_(connection)
        self.uses(lambda: dealings.has_opened or connection.ended, seconds)
        return dealings.has_opened

    def calls(self) -> list[Call]:
        """The calls of the stand-in CUDA runtime since the trial began."""
        return self.stand_in.calls()[self._calls_before :] if self.stand_in else []
