"""The first meeting with a client: what it does when left alone.

Checks ask no more of it than it has shown here.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from splatbus_conformance.trials import memory_pace
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee import os_evidence, probe_advice
from splatbus_conformance.trials.testee.adapter import Greeting
from splatbus_conformance.trials.testee.facts import Facts
from splatbus_conformance.trials.testee.process import Testee, not_met
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.trials.trial import SETTLE_SECONDS as TRIAL_SETTLE_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.json_values import texts, within
from splatbus_conformance.wire.message_kinds import POSES, REQUESTS, REQUESTS_1_0, newer
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection, Peer

SETTLE_SECONDS = 1.0
MEMORY_SECONDS = 10.0
"""For which one that has said hello is waited for, until it has opened memory and read an image."""
QUIET_SECONDS = 2.0
"""In which something new comes from a client that has not yet said all that it says."""
PARTING_SECONDS = 0.5
RETURN_SECONDS = 5.3
"""How long it may take to come back (CHN-22), and a little more."""
SLOW_SECONDS = 2.0
PACES = 3.0
"""How much longer than the longest answer so far another may take."""
MOST_EFFECT_SECONDS = 30.0


@dataclass
class ClientFacts(Facts):
    """What the testee showed of itself when it was first met."""

    hello: dict[Channel, Json | None] = field(default_factory=lambda: {"ipc": None, "msg": None})
    connects: set[Channel] = field(default_factory=set)
    asks_on: bool | None = None
    """It asks for more after a reply, or again; None as long as nobody has looked."""
    asks: set[str] = field(default_factory=set)
    """Types of the requests that it makes when it connects."""
    says: set[str] = field(default_factory=set)
    """Types of all that it sends when it connects."""
    says_more: bool = False
    """On each new message connection it says what 1.0 does not define, once that was agreed on."""
    takes_sizes: bool = True
    """Images of every size that it asks for can be given."""
    poses: bool = False
    """It sends poses unasked."""
    opens: bool = False
    """It opened the memory that it was offered."""
    adapter: Greeting | None = None
    """What the adapter beside it says of itself, where there is one."""
    returns: set[Channel] = field(default_factory=set)
    """Channels that it connects to again after its connection was closed."""
    expendable: bool = False
    """The harness can start it anew, which makes new connections of one that does not return."""
    leaves: bool = False
    """Its process ends, in an orderly way, once its server has gone."""
    asks_again: bool = False
    """It asks on each new connection, not only on the first of its process."""
    notices_the_end: bool | None = None
    """After replies it closes a connection whose stream ends; None until a check has to know."""
    probes: dict[Channel, int] = field(default_factory=dict)
    """How many connections it opens and closes by itself after its start, before it stays."""
    start_seconds: float = 0.0
    """From its start to its first connection."""
    memory_seconds: float = 0.0
    """From the first offer of memory until it was opened and read; see `memory_pace`."""
    slowest_answer: float = 0.0
    """The longest that it was seen to take for its first word, or for an answer, in seconds."""
    away_seconds: float = 0.0
    """The longest that it stayed away before it came back, while it was listened for."""

    @property
    def waited_for(self) -> float:
        """For how long it has to be waited for, now and then: its start, or that it comes back."""
        return max(self.start_seconds, self.away_seconds)

    @property
    def effect_seconds(self) -> float:
        """How long an effect is waited for that no sentence limits, at this testee's pace."""
        return min(max(EFFECT_SECONDS, PACES * self.slowest_answer), MOST_EFFECT_SECONDS)

    def took(self, seconds: float) -> None:
        """Note how long an answer took."""
        self.slowest_answer = max(self.slowest_answer, seconds)

    def was_away(self, peer: Peer, back: Connection, born: float) -> None:
        """Note how long it stayed away that could have come back.

        Args:
            peer: that it came back to.
            back: its new connection.
            born: when its process was started, by the monotonic clock; 0 if that is not known.
        """
        former = [c for c in peer.connections if c.channel == back.channel and c is not back]
        left = max((c.gone_since for c in former if c.gone_since is not None), default=None)
        if left is not None and left >= born:
            away = back.opened - max(left, peer.listens_since[back.channel])
            self.away_seconds = max(self.away_seconds, away)

    def speaks_1_1(self, channel: Channel) -> bool:
        """It said `hello` on this channel."""
        return self.hello[channel] is not None

    def capabilities(self, channel: Channel = "ipc") -> list[str]:
        """What it declared on a channel."""
        return texts(within(self.hello[channel], "capabilities"))

    def version(self) -> str:
        """The newest version that it speaks: it is judged by that."""
        return "1.1" if any(self.hello.values()) else "1.0"

    def everything_said(self) -> bool:
        """It has said whatever a client may say when it is met."""
        shown = all(self.hello.values()) and self.asks >= set(REQUESTS_1_0) and self.poses
        return shown and (self.opens or "host_shm" not in self.capabilities())

    def everything(self) -> bool:
        """There is nothing that a second meeting would have to show."""
        reads = self.opens or "host_shm" not in self.capabilities()
        alike = len({value is None for value in self.hello.values()}) == 1
        speaks = bool(self.asks) and reads and alike
        return speaks and self.returns == set(CHANNELS)

    def __str__(self) -> str:
        """What it did when it was left alone, for those who know what it should have done."""
        if not self.connects:
            return "it connects to neither channel"
        where = " and ".join(WORDS[it] for it in CHANNELS if it in self.connects)
        back = [WORDS[it] for it in CHANNELS if it in self.returns]
        parts = [
            f"it speaks {self.version()}",
            f"connects to {where}",
            f"sends {', '.join(sorted(self.says))}"
            if self.says
            else "sends nothing that can be read",
        ]
        if self.version() == "1.1":
            parts.append("opens the memory" if self.opens else "does not open the memory")
        parts.append(f"comes back to {' and '.join(back)}" if back else "does not come back")
        if self.asks and back and not self.asks_again:
            parts.append("asks only once a start")
        if self.probes:
            parts.append("opens connections first that it closes again")
        if self.start_seconds >= SLOW_SECONDS:
            parts.append(f"takes {self.start_seconds:.0f} s to start")
        return ", ".join(parts)

    def lacks(self, need: str) -> str | None:
        """Why a check that needs this can show nothing, or None if it can."""
        kind, _, of = need.partition(":")
        if kind in ("stand-in", "device"):
            return self.device_lacks(kind)
        if kind not in ("adapter", "axes"):
            known, why = NEEDS[kind](self, of)
            return None if known else f"the testee {why}"
        if self.adapter is None:
            return "only an adapter could show it: --adapter"
        if kind == "adapter":
            return None if of in self.adapter.can else f"the adapter has no command {of}"
        axes = self.adapter.axes
        return None if of == axes else f"its poses are in the axes of {axes}"


NEEDS: dict[str, Callable[[ClientFacts, Any], tuple[object, str]]] = {
    "hello": lambda it, of: (
        it.speaks_1_1(of),
        f"says no hello on the {of} channel: 1.1 is not claimed",
    ),
    "ipc": lambda it, _: ("ipc" in it.connects, "makes no connection on the ipc channel"),
    "msg": lambda it, _: ("msg" in it.connects, "makes no connection on the msg channel"),
    "returns": lambda it, of: (
        of in it.returns or (it.expendable and of in it.connects),
        f"does not connect to the {of} channel again",
    ),
    "reconnects": lambda it, of: (of in it.returns, f"does not connect to the {of} channel again"),
    "capability": lambda it, of: (of in it.capabilities(), f"does not declare the capability {of}"),
    "asks": lambda it, _: (it.asks, "makes no request when it connects"),
    "says": lambda it, of: (of in it.says, f"sends no {of} when it connects"),
    "poses": lambda it, _: (it.poses, "sends no poses unasked that can be read"),
    "opens": lambda it, of: (
        it.opens or (of == "unless-silent" and not it.speaks_1_1("ipc")),
        "did not open good memory when it was first met",
    ),
}
"""Of each need but a device's and an adapter's: whether it is met, and what is the case if not."""


def introduce(
    peer: Peer, new_role: Callable[[], ScriptedServer], testee: Testee, patience: float
) -> ClientFacts:
    """Meet the testee as a well-behaved server: what does it say, ask, send, and does it return?

    One that the harness starts, and that showed less than some do, is met again: the machine may
    have been busy.

    Raises NoVerdict if no connection comes within `patience` seconds.
    """
    facts = _meet(peer, new_role(), testee, patience)
    if testee.expendable and not facts.everything():
        testee.stop()
        peer.pump(TRIAL_SETTLE_SECONDS)
        facts = _both(facts, _meet(peer, new_role(), testee, patience))
    return facts


def _both(first: ClientFacts, second: ClientFacts) -> ClientFacts:
    """What was shown at either of two meetings."""
    return replace(
        first,
        hello={channel: first.hello[channel] or second.hello[channel] for channel in CHANNELS},
        connects=first.connects | second.connects,
        asks=first.asks | second.asks,
        says=first.says | second.says,
        poses=first.poses or second.poses,
        opens=first.opens or second.opens,
        returns=first.returns | second.returns,
        asks_again=first.asks_again or second.asks_again,
        says_more=first.says_more or second.says_more,
        takes_sizes=first.takes_sizes and second.takes_sizes,
        leaves=first.leaves or second.leaves,
        start_seconds=max(first.start_seconds, second.start_seconds),
        memory_seconds=max(first.memory_seconds, second.memory_seconds),
        away_seconds=max(first.away_seconds, second.away_seconds),
        slowest_answer=max(first.slowest_answer, second.slowest_answer),
        advice=list(second.advice),
    )


def _meet(peer: Peer, role: ScriptedServer, testee: Testee, patience: float) -> ClientFacts:
    peer.clear()
    peer.on_open, peer.on_message = role.on_open, role.on_message
    began = time.monotonic()
    testee.ensure_running()
    peer.until(lambda: peer.connections or testee.ended(), patience)
    if not peer.connections:
        where = " and ".join(f"{name} {peer.host}:{peer.ports[name]}" for name in CHANNELS)
        raise not_met(testee, "client", where, peer.host, patience)
    start = time.monotonic() - began
    settle = max(SETTLE_SECONDS, start / 3)
    peer.until(lambda: {c.channel for c in peer.connections} == set(CHANNELS), settle)
    slowest = _hear_out(peer, role, max(QUIET_SECONDS, settle), patience)
    pace = memory_pace.of_the_host(peer, role, testee, MEMORY_SECONDS)
    met = list(peer.connections)
    facts = _shown(met, role)
    facts.took(slowest)
    facts.expendable, facts.start_seconds = testee.expendable, start
    facts.memory_seconds = pace
    facts.probes = _probes(met)
    seen = [_met(connection, role, testee) for connection in met]
    left = str(testee.ended() or "")
    facts.advice = probe_advice.on_client(seen, peer.ports, testee.group, left)
    _take_leave(peer, met)

    def back() -> set[Channel]:
        return {c.channel for c in peer.connections if c not in met}

    peer.until(lambda: back() == facts.connects or testee.ended(), RETURN_SECONDS)
    facts.returns = back() & {c.channel for c in met}  # a late first connection is no return
    facts.connects |= back()
    for connection in peer.connections:
        if connection not in met:
            facts.was_away(peer, connection, testee.started)
    ended = testee.ended()
    facts.leaves = ended is not None and not ended.crashed

    def later() -> ClientFacts:
        return _shown([c for c in peer.connections if c not in met], role)

    def says_it_again() -> bool:
        return later().asks >= facts.asks and later().says_more >= facts.says_more

    if "msg" in facts.returns:
        if facts.asks or facts.says_more:
            peer.until(says_it_again, max(settle, facts.effect_seconds / 2))
        facts.asks_again = bool(facts.asks) and later().asks >= facts.asks
    facts.says_more = later().says_more
    facts.takes_sizes = role.gives_sizes
    peer.pump(TRIAL_SETTLE_SECONDS)
    return facts


def _hear_out(peer: Peer, role: ScriptedServer, quiet: float, patience: float) -> float:
    """Until it has said all that a client may say, or has said nothing new for so long; who has
    been offered memory is given the patience of the run to open it.

    Returns the longest that it was silent before something new.
    """
    said, since, longest = _shown(peer.connections, role), time.monotonic(), 0.0

    def news() -> bool:
        return _shown(peer.connections, role) != said

    while not said.everything_said():
        opening = any(d.generations and not d.opened | d.failed for d in role.dealings.values())
        if not peer.until(news, max(patience, quiet) if opening else quiet):
            break
        said, now = _shown(peer.connections, role), time.monotonic()
        if not opening:  # that is not how fast it talks: see `memory_pace`
            longest = max(longest, now - since)
        since = now
    return longest


def _probes(met: Sequence[Connection]) -> dict[Channel, int]:
    """How many connections the testee opened and closed by itself before one that it kept."""
    found: dict[Channel, int] = {}
    for channel in CHANNELS:
        on_it = [connection for connection in met if connection.channel == channel]
        if len(on_it) > 1 and on_it[0].ended and not on_it[-1].ended:
            found[channel] = sum(connection.ended is not None for connection in on_it)
    return found


def _take_leave(peer: Peer, met: Sequence[Connection]) -> None:
    """Close, and let the testee close first: what it sends to one that is closed resets it."""
    for connection in met:
        connection.end_stream()
    peer.until(lambda: all(connection.ended for connection in met), PARTING_SECONDS)
    for connection in met:
        connection.close()


def _shown(connections: Sequence[Connection], role: ScriptedServer) -> ClientFacts:
    facts = ClientFacts()
    for connection in connections:
        dealings = role.with_(connection)
        facts.connects.add(connection.channel)
        facts.hello[connection.channel] = facts.hello[connection.channel] or dealings.hello
        told = (message.get("type", "what has no type") for message in dealings.heard)
        kinds = {kind if isinstance(kind, str) else shorten(repr(kind)) for kind in told}
        facts.says |= kinds
        if connection.channel == "msg":
            facts.asks |= kinds & set(REQUESTS)
            facts.poses = facts.poses or bool(kinds & set(POSES))
            facts.says_more = facts.says_more or any(map(newer, dealings.heard))
        facts.opens = facts.opens or bool(dealings.opened)
    return facts


def _met(
    connection: Connection, role: ScriptedServer, testee: Testee
) -> probe_advice.ObservedConnection:
    failed = role.with_(connection).all_of("open_failed")
    return probe_advice.observed(connection, connection.port)._replace(
        ended=connection.ended is not None,
        offered=_offered(role, connection),
        failed=str(failed[0].get("reason")) if failed else "",
        process=_process(connection, testee),
        unfinished=connection.unfinished,
        rate=_rate(connection),
    )


def _rate(connection: Connection) -> float:
    """Messages a second, since its first."""
    times = [connection.arrived(it) for it in connection.messages]
    return len(times) / max(times[-1] - times[0], SETTLE_SECONDS) if times else 0.0


def _offered(role: ScriptedServer, connection: Connection) -> str:
    """What a client was told of images on a connection, if it was told any."""
    dealings = role.with_(connection)
    told = dealings.generation or dealings.count("get_viewport_size")
    return f"images of {role.width}x{role.height}" if told else ""


def _process(connection: Connection, testee: Testee) -> int | None:
    """The process at the other end; those that the harness started count as one."""
    process = os_evidence.owner(connection.testee_port, connection.port)
    return testee.group if process and os_evidence.group(process) == testee.group else process
