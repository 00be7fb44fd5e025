"""A session while it lasts: what is said how often, how long answers take, what is broken.

Values only: the proxy feeds it what crosses, and shows what it says.
"""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import quantiles
from typing import Any, NamedTuple

from splatbus_conformance.audit import Audit, audit_of
from splatbus_conformance.conversation import Assembler, Conversation, Message
from splatbus_conformance.kinds import REPLIES, REQUESTS
from splatbus_conformance.recording import Channel, Direction, Entry

RATE_SECONDS = 2.0
NEWEST = 500
"""Latencies that are kept of each kind."""
MOST_TAGS = 1000
GROWTH = 1.25
"""A session is judged anew when it has grown by this factor: all judging together costs what a few
looks at the whole cost, however long it lasts."""

Kind = tuple[Channel, Direction, str]


class Line(NamedTuple):
    """What is known of one kind of message."""

    channel: Channel
    direction: Direction
    kind: str
    seen: int
    per_second: float
    bytes: int


class Latency(NamedTuple):
    """Seconds that something took, of the newest few hundred times."""

    of: str
    """`reply` to a request, or `tag`: from a pose to the first frame that shows it."""
    times: int
    p50: float
    p99: float


@dataclass
class Live:
    """Everything that the proxy shows of a session."""

    assembler: Assembler = field(default_factory=Assembler)
    now: float = 0.0
    """Seconds since the session began, at the last entry or look."""
    _counts: Counter[Kind] = field(default_factory=Counter)
    _bytes: Counter[Kind] = field(default_factory=Counter)
    _recent: deque[tuple[float, Kind]] = field(default_factory=deque)
    _asked: defaultdict[int, deque[float]] = field(default_factory=lambda: defaultdict(deque))
    _tags: dict[str, float] = field(default_factory=dict)
    _took: defaultdict[str, deque[float]] = field(
        default_factory=lambda: defaultdict(lambda: deque(maxlen=NEWEST))
    )
    _judged_at: int = 0

    def feed(self, entry: Entry) -> None:
        """Take what crossed next."""
        self.now = max(self.now, entry.t)
        conversation, messages = self.assembler.feed(entry)
        for message in messages:
            self._count(conversation, message)
            if message.value is not None:
                self._time(conversation, message, message.value)

    def lines(self) -> list[Line]:
        """Each kind of message that was seen, channel by channel, clients' first."""
        while self._recent and self._recent[0][0] < self.now - RATE_SECONDS:
            self._recent.popleft()
        rates = Counter(kind for _, kind in self._recent)
        span = min(RATE_SECONDS, max(self.now, 1e-3))
        return [
            Line(*kind, count, rates[kind] / span, self._bytes[kind])
            for kind, count in sorted(self._counts.items())
        ]

    def latencies(self) -> list[Latency]:
        """What was measured so far."""
        return [
            Latency(of, len(took), *_percentiles(took)) for of, took in sorted(self._took.items())
        ]

    def connections(self) -> dict[Channel, tuple[int, int]]:
        """By channel: how many are open, how many there were."""
        found: dict[Channel, tuple[int, int]] = {"ipc": (0, 0), "msg": (0, 0)}
        for conversation in self.assembler.conversations:
            still, total = found[conversation.channel]
            found[conversation.channel] = still + (not conversation.ended), total + 1
        return found

    @property
    def is_due(self) -> bool:
        """Whether enough has come since the last judgement for another."""
        seen = self._counts.total()
        return seen > 0 and seen >= GROWTH * self._judged_at

    def judged(self) -> Audit:
        """What the session shows of both peers, so far."""
        self._judged_at = self._counts.total()
        return audit_of(self.assembler.so_far())

    def _count(self, conversation: Conversation, message: Message) -> None:
        kind = (conversation.channel, message.direction, _name(message))
        self._counts[kind] += 1
        self._bytes[kind] += len(message.packet.payload)
        self._recent.append((self.now, kind))

    def _time(self, conversation: Conversation, message: Message, value: dict[str, Any]) -> None:
        asked = self._asked[id(conversation)]
        if message.kind in REQUESTS:
            asked.append(message.packet.ended)
        elif asked and (message.kind in REPLIES or (message.kind == "error" and "id" in value)):
            self._took["reply"].append(message.packet.ended - asked.popleft())
        elif message.kind == "camera_pose" and isinstance(value.get("tag"), str):
            self._tags[value["tag"]] = message.packet.ended
            if len(self._tags) > MOST_TAGS:
                self._tags.pop(next(iter(self._tags)))
        elif message.kind == "frame":
            camera = value.get("camera")
            tag = camera.get("tag") if isinstance(camera, dict) else None
            if isinstance(tag, str) and (sent := self._tags.pop(tag, None)) is not None:
                self._took["tag"].append(message.packet.ended - sent)


def _name(message: Message) -> str:
    # Never its own word for itself: what a peer calls a message may hold anything.
    return message.kind or ("of an unknown type" if message.value is not None else "no message")


def _percentiles(took: Iterable[float]) -> tuple[float, float]:
    values = sorted(took)
    if len(values) == 1:
        return values[0], values[0]
    cuts = quantiles(values, n=100, method="inclusive")
    return cuts[49], cuts[98]
