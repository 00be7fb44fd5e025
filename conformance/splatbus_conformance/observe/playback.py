"""Play one side of a recording again: its bytes, in their order, to whoever is on the other side.

Both sides took turns when they were recorded. So what a peer sent after it had heard something
waits until that is heard again; what comes all the time, such as frames and poses, is not waited
for. Pauses last as long as they did, within a limit.
"""

import contextlib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from splatbus_conformance.plan import Side
from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.wire.conversation import Assembler, Message
from splatbus_conformance.wire.recording import Channel, Direction, Entry, Event
from splatbus_conformance.wire.sockets import Connection, Peer

MOST_PAUSE_SECONDS = 1.0
TURN_SECONDS = 3.0
"""How long to wait for what was heard before."""
SAYS: dict[Side, Direction] = {"client": "c2s", "server": "s2c"}
STREAMS = (
    *("camera_pose", "point_cloud_pose", "object_pose", "set_time"),
    *("frame", "release", "telemetry", "error"),
)
"""What comes all the time, or not always: there may be more of it, or less, another time."""

Place = tuple[Channel, int]
"""A channel, and the how-manieth of its connections, counted from 0."""


class Step(NamedTuple):
    """What the recorded peer did."""

    pause: float
    """Seconds since its last step."""
    place: Place
    data: bytes | None
    event: Event | None
    heard: Counter[Place]
    """How many messages it had heard by then, on each connection."""


class Played(NamedTuple):
    """What came of it."""

    steps: int
    delivered: int
    missed: tuple[str, ...]
    """What was waited for, and did not come."""


class _Hearing:
    """Counts the messages of one side that somebody may have waited for."""

    def __init__(self, side: Side) -> None:
        self.heard: Counter[Place] = Counter()
        self._side = side
        self._assembler = Assembler()
        self._places: dict[tuple[str, int], Place] = {}

    def feed(self, entry: Entry) -> Place:
        """Take what crossed next, on which connection it did."""
        conversation, messages = self._assembler.feed(entry)
        key = conversation.channel, conversation.number
        if key not in self._places:
            rank = sum(channel == conversation.channel for channel, _ in self._places)
            self._places[key] = conversation.channel, rank
        self.heard[self._places[key]] += sum(map(self._counts, messages))
        return self._places[key]

    def _counts(self, message: Message) -> bool:
        return message.sender == self._side and message.kind not in STREAMS


def steps(entries: Iterable[Entry], testee: Side) -> list[Step]:
    """What the peer of this testee did in a recording."""
    hearing, found, last = _Hearing(testee), list[Step](), 0.0
    for entry in entries:
        before = hearing.heard.copy()
        place = hearing.feed(entry)
        opens = entry.event == "open" and testee == "server"
        if opens or entry.dir not in (None, SAYS[testee]):
            pause = entry.t - (last if found else entry.t)
            found.append(Step(pause, place, entry.data, entry.event, before))
            last = entry.t
    return found


def play(given: Sequence[Step], peer: Peer, testee: Testee, patience: float) -> Played:
    """Do these steps with a testee that runs.

    Args:
        given: what to do.
        peer: plays the side that was recorded; its entries hold what comes of it.
        testee: not waited for once it has ended.
        patience: longest wait for a connection, in seconds.
    """
    play = _Play(peer, testee, patience)
    delivered = sum(play.does(step) for step in given)
    return Played(len(given), delivered, tuple(play.missed))


class _Play:
    def __init__(self, peer: Peer, testee: Testee, patience: float) -> None:
        self.missed: list[str] = []
        self._peer = peer
        self._testee = testee
        self._patience = patience
        self._side: Side = "client" if peer.ours == "s2c" else "server"
        self._hearing = _Hearing(self._side)
        self._fed = 0
        self._lacking: Counter[Place] = Counter()
        """Messages that did not come, and are not waited for again."""
        self._absent: set[Place] = set()
        """Connections that did not come."""

    def does(self, step: Step) -> bool:
        """Do one step; whether it could be done."""
        if step.place in self._absent:
            return False
        self._peer.pump(min(step.pause, MOST_PAUSE_SECONDS))
        self._listen(step.heard)
        if (connection := self._connection(step)) is None:
            self._absent.add(step.place)
            self.missed.append(f"connection {step.place[1] + 1} on {step.place[0]}")
            return False
        done = connection.open and not connection.ended
        if step.data is not None:
            connection.send(step.data)
        elif step.event == "eof":
            connection.end_stream()
        elif step.event == "reset":
            connection.reset()
        return done

    def _listen(self, wanted: Counter[Place]) -> None:
        """Wait for as much as had been heard."""
        wanted = wanted - Counter({place: wanted[place] for place in self._absent})
        if self._until(lambda: self._heard() + self._lacking >= wanted, TURN_SECONDS):
            return
        for place, count in (wanted - self._heard() - self._lacking).items():
            self._lacking[place] += count
            channel, rank = place
            name = (
                f"message {wanted[place]} of the {self._side} on connection {rank + 1}, {channel}"
            )
            self.missed.append(name)

    def _heard(self) -> Counter[Place]:
        for entry in self._peer.entries[self._fed :]:
            self._hearing.feed(entry)
        self._fed = len(self._peer.entries)
        return self._hearing.heard

    def _connection(self, step: Step) -> Connection | None:
        channel, rank = step.place

        def found() -> Connection | None:
            there = [each for each in self._peer.connections if each.channel == channel]
            if len(there) <= rank and self._side == "server":
                with contextlib.suppress(OSError):
                    return self._peer.dial(channel)
            return there[rank] if len(there) > rank else None

        self._peer.until(lambda: found() or self._ended(), self._patience)
        return found()

    def _until(self, happened: Callable[[], bool], seconds: float) -> bool:
        self._peer.until(lambda: happened() or self._ended(), seconds)
        return happened()

    def _ended(self) -> bool:
        return self._testee.ended() is not None
