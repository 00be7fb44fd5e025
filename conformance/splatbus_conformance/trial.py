"""A trial: one check's dealings with the testee, from connecting to judgement."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn, TypeVar

import pytest
from hypothesis.strategies import SearchStrategy
from splatbus_schemas import LIMITS
from splatbus_schemas.requirements import Requirement

from splatbus_conformance.drawing import draw
from splatbus_conformance.messages import Json, encode
from splatbus_conformance.packets import packet
from splatbus_conformance.peer import Connection, Peer
from splatbus_conformance.recording import Channel
from splatbus_conformance.role import Role
from splatbus_conformance.testee import Testee

T = TypeVar("T")
JITTER_SECONDS = 0.03
"""How much closer two events may look than they were, since the harness sees them late."""
SETTLE_SECONDS = 0.05
"""Time for what was sent last to be understood; a client that is cut off before that backs off."""
EFFECT_SECONDS: float = LIMITS["close_seconds"]
"""How long a check waits for an effect; the time that spec 1.0 section 1.2 gives a close."""
REACTION_SECONDS = 0.2
"""How long a check listens for what need not come."""
MANY_CONNECTIONS = 6
"""From which on the quick profile delivers one of `RARELY` cases."""
RARELY = 16


class Violation(AssertionError):  # noqa: N818 - a finding, no error of ours
    """The testee did what the requirement does not accept; the message says what."""


@dataclass
class Facts:
    """What the testee showed of itself when it was first met."""

    hello: dict[Channel, Json | None] = field(default_factory=lambda: {"ipc": None, "msg": None})
    connects: set[Channel] = field(default_factory=set)
    asks: set[str] = field(default_factory=set)
    """Types of the requests that it makes when it connects."""
    poses: bool = False
    """It sends poses unasked."""
    opens: bool = False
    """It opened the memory that it was offered."""
    returns: set[Channel] = field(default_factory=set)
    """Channels that it connects to again after its connection was closed."""

    def speaks_1_1(self, channel: Channel) -> bool:
        """It said `hello` on this channel."""
        return self.hello[channel] is not None

    def capabilities(self) -> list[str]:
        """What it declared on the IPC channel."""
        declared: Any = (self.hello["ipc"] or {}).get("capabilities", [])
        return declared if isinstance(declared, list) else []


class Trial:
    """What a check has in hand: the raw peer, the role it plays, the testee, and its judgement."""

    def __init__(
        self,
        requirement: Requirement,
        peer: Peer,
        role: Role,
        testee: Testee,
        facts: Facts,
        patience: float,
    ) -> None:
        self.requirement = requirement
        self.peer = peer
        self.role = role
        self.testee = testee
        self.facts = facts
        self.patience = patience
        self.delivered = 0
        """Cases that were delivered and followed by something that proves it."""
        self.seed = 0
        self.profile = "quick"
        self._used: set[Connection] = set()
        peer.clear()
        peer.on_open = role.on_open
        peer.on_packet = role.on_packet

    def cases(self, strategy: SearchStrategy[T], quick: int, full: int) -> list[T]:
        """Cases drawn by Hypothesis, so many in each profile; the same ones for the same seed."""
        return draw(strategy, full if self.profile == "full" else quick, self.seed)

    def affordable(self, cases: Iterable[T]) -> Iterator[T]:
        """All cases; in the quick profile few of them once the testee needs many connections.

        A client may close the connection on whatever is wrong, and each case then costs it a pause.
        """
        for number, case in enumerate(cases):
            few = self.profile == "full" or len(self.peer.connections) < MANY_CONNECTIONS
            if few or number % RARELY == 0:
                yield case

    # Meeting the testee

    def connection(self, channel: Channel, seconds: float | None = None) -> Connection:
        """A connection of the testee on this channel that this trial has not used yet.

        Closes those that it has used, so that the testee makes a new one, and starts it anew where
        that does not help. Skips the check if none comes within the run's patience.
        """
        seconds = self.patience if seconds is None else seconds
        self.testee.ensure_running()
        found = self.next_connection(channel, seconds)
        if found is None:
            self.testee.stop()
        if found is None and self.testee.ensure_running():
            found = self.next_connection(channel, seconds)
        if found is None:
            self.not_observable(f"the testee made no connection on the {channel} channel")
        return found

    def next_connection(self, channel: Channel, seconds: float | None = None) -> Connection | None:
        """Close those of this channel that were used; a new one, if it comes in time.

        None of a testee that has hung, died or exited: unlike `connection`, this starts no other.
        """
        for used in self._used:
            if used.channel == channel:
                used.close()
        seconds = self.patience if seconds is None else seconds
        self.peer.until(lambda: self._unused(channel) or self.testee.ended(), seconds)
        found = self._unused(channel)
        if found is not None:
            self._used.add(found)
        return found

    def greeted(self, channel: Channel) -> Connection:
        """A new connection on which the testee has said `hello` and was given `welcome`."""
        connection = self.connection(channel)
        self.wait(lambda: self.role.with_(connection).welcome)
        if self.role.with_(connection).welcome is None:
            self.not_observable("the testee said no hello on this connection")
        return connection

    def for_init_packet(self) -> Connection:
        """A greeted IPC connection that may be sent one more init packet: the last one if it may.

        Only with `role.offers_memory` off, so that the check sends every init packet itself.
        """
        for connection in reversed(self.peer.connections):
            alive = connection in self._used and connection.open and not connection.ended
            if alive and connection.channel == "ipc" and self._takes_another(connection):
                return connection
        return self.greeted("ipc")

    def asking(self) -> Connection:
        """A new message connection on which the testee has made a request, not answered yet."""
        self.role.replies = False
        connection = self.connection("msg")
        dealings = self.role.with_(connection)
        asked = self.wait(
            lambda: dealings.count("get_camera_pose") + dealings.count("get_viewport_size")
        )
        self.role.replies = True
        if not asked:
            self.not_observable("the testee makes no request when it connects")
        return connection

    # Waiting and watching

    def wait(self, condition: Callable[[], Any], seconds: float = EFFECT_SECONDS) -> bool:
        """Wait until the condition holds or the testee's process has ended; whether it holds."""
        self.peer.until(lambda: condition() or self.testee.ended(), seconds)
        return bool(condition())

    def ends(self, connection: Connection, seconds: float = EFFECT_SECONDS) -> bool:
        """Whether the testee ends this connection in time."""
        return self.wait(lambda: connection.ended, seconds)

    def opens(self, connection: Connection) -> bool:
        """Whether the testee opens the memory that was offered last on this connection."""
        dealings = self.role.with_(connection)
        return self.wait(lambda: dealings.generation in dealings.opened or connection.ended) and (
            dealings.generation in dealings.opened
        )

    def releases(self, connection: Connection, seq: int) -> bool:
        """Whether the testee releases this frame."""
        dealings = self.role.with_(connection)
        return self.wait(lambda: seq in dealings.released or connection.ended) and (
            seq in dealings.released
        )

    def says_hello(self, connection: Connection) -> bool:
        """Whether the testee says `hello` on this connection."""
        return self.wait(lambda: self.role.with_(connection).hello)

    def arrives(self, channel: Channel, seconds: float, after: int = 0) -> bool:
        """Whether there are more than `after` connections on this channel in time."""
        return self.wait(
            lambda: sum(c.channel == channel for c in self.peer.connections) > after, seconds
        )

    def rest(self, seconds: float) -> None:
        """Let time pass, and handle what happens in it."""
        self.peer.pump(seconds)

    def fate(self) -> str | None:
        """`dies` or `exits` if the testee's process has ended, else None."""
        ended = self.testee.ended()
        if ended is None:
            return None
        return "dies" if ended.crashed else "exits"

    # Scripts, and what becomes of them

    def outcome_on_ipc(self, connection: Connection, *scripts: bytes) -> str:
        """Deliver scripts on a greeted IPC connection, then a good init packet as the control.

        Returns `ignores` (the good packet was opened), `declines` or `accepts` (one that the
        scripts announced), `refuses` (the good packet), `closes` (and came back), `exits`, `dies`
        or `hangs`.
        """
        dealings = self.role.with_(connection)
        heard = len(dealings.heard)
        for script in scripts:
            connection.send(script)
        # A client without reinit may ignore the good packet for a further one (OPN-6).
        further = self._takes_further(connection)
        good = packet(encode(self.role.init_packet(connection)))
        generation = dealings.generation
        connection.send(good)
        self.wait(
            lambda: generation in dealings.opened | dealings.failed or connection.ended,
            EFFECT_SECONDS if further else REACTION_SECONDS,
        )
        answers = {
            message.get("type")
            for message in dealings.heard[heard:]
            if message.get("generation") != generation
        }
        if "opened" in answers:
            return "accepts"
        outcome = "declines" if "open_failed" in answers else "ignores"
        if generation in dealings.opened:
            self.delivered += 1
            return outcome
        if generation in dealings.failed:
            return "refuses"
        if connection.ended or further or self.fate():
            return self._end_of(connection, "ipc")
        return outcome if self.comes_back("ipc") else self.fate() or "hangs"

    def outcome_of_reply(self, script: bytes) -> str:
        """Answer the testee's first request on a new connection with a script.

        Returns `ignores` (it goes on), `closes` (and came back), `exits`, `dies` or `hangs`.
        """
        connection = self.asking()
        connection.send(script)
        return self.outcome_on_msg(connection)

    def outcome_on_msg(self, connection: Connection) -> str:
        """What the testee does after what it was sent on the message channel, as above."""
        before = len(connection.packets)
        self.wait(
            lambda: len(connection.packets) > before + 1 or connection.ended,
            1.0 if self.facts.poses else REACTION_SECONDS,
        )
        if not connection.ended and len(connection.packets) > before + 1:
            self.delivered += 1
            return "ignores"
        if not connection.ended and self.fate() is None:
            return "ignores" if self.comes_back("msg") else self.fate() or "hangs"
        return self._end_of(connection, "msg")

    def comes_back(self, channel: Channel) -> bool:
        """Whether the testee connects to this channel again and says something that it means.

        A client that speaks 1.0 has nothing to say on the IPC channel.
        """
        connection = self.next_connection(channel)
        if connection is None:
            return False
        back = True
        if channel == "ipc" and self.facts.speaks_1_1("ipc"):
            dealings = self.role.with_(connection)
            back = self.wait(
                lambda: dealings.welcome or (dealings.hello and not self.role.welcomes)
            )
            if back and dealings.welcome and self.facts.opens:
                if not self.role.offers_memory:
                    self.role.offer(connection, self.role.init_packet(connection))
                back = self.wait(lambda: dealings.generation in dealings.opened)
        elif channel == "msg":
            back = self.wait(lambda: connection.packets)
        self.delivered += back
        return back

    def _end_of(self, connection: Connection, channel: Channel) -> str:
        self.wait(lambda: self.fate(), 0.05)
        if fate := self.fate():
            return fate
        if not connection.ended:
            return "hangs"
        if channel not in self.facts.returns:
            self.not_observable(
                "the testee closed the connection and is not known to come back: "
                "a clean close and a dead listener look alike"
            )
        return "closes" if self.comes_back(channel) else self.fate() or "hangs"

    def _unused(self, channel: Channel) -> Connection | None:
        return next(
            (
                c
                for c in self.peer.connections
                if c.channel == channel and c not in self._used and c.open and not c.ended
            ),
            None,
        )

    def _takes_further(self, connection: Connection) -> bool:
        return "reinit" in (self.role.with_(connection).welcome or {}).get("capabilities", [])

    def _takes_another(self, connection: Connection) -> bool:
        dealings = self.role.with_(connection)
        first = dealings.welcome is not None and not dealings.generation
        return first or self._takes_further(connection)

    # Judgement

    def judge(self, outcome: str, what: str) -> None:
        """Compare an outcome with those that the specification accepts for this requirement."""
        if outcome not in self.requirement.acceptable:
            self.violated(f"{what}: the testee {OUTCOME_WORDS.get(outcome, outcome)}")

    def expect(self, holds: object, what: str) -> None:
        """The requirement is violated unless `holds`; `what` says what was seen instead."""
        if not holds:
            self.violated(what)

    def violated(self, what: str) -> NoReturn:
        """The requirement is violated."""
        if ended := self.testee.ended():
            what += f"; its process {ended}"
        raise Violation(what)

    def not_observable(self, reason: str) -> NoReturn:
        """Nothing can be said: skip, with the reason."""
        if ended := self.testee.ended():
            reason += f"; its process {ended}"
        pytest.skip(reason)


OUTCOME_WORDS = {
    "accepts": "took it as valid",
    "closes": "closed the connection",
    "declines": "answered open_failed",
    "dies": "died",
    "exits": "exited",
    "hangs": "neither reacted nor went on",
    "ignores": "ignored it and went on",
    "keeps": "kept its state",
    "reconnects": "connected again",
    "refuses": "answered open_failed to the good init packet that followed",
    "waits": "waited",
}
