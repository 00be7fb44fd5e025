"""A session while it lasts: what is said how often, how long answers take, what is broken.

Values only: whoever reads the recording feeds it what crosses.
"""

from collections import Counter, deque
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from splatbus_conformance.observe.audit import Audit, audit_of
from splatbus_conformance.reports.latencies import Histogram, Stopwatch
from splatbus_conformance.wire.conversation import Assembler, Conversation, Message
from splatbus_conformance.wire.recording import Channel, Direction, Entry

RATE_SECONDS = 2.0
GROWTH = 1.25
"""A session is judged anew when it has grown by this factor: all judging together costs what a few
looks at the whole cost, however long it lasts."""
MOST_JUDGED = 200_000
"""Messages that are kept to be judged. A session of days must not fill the memory; its recording
holds what came after them."""

Kind = tuple[Channel, Direction, str]


class KindStatistics(NamedTuple):
    """What is known of one kind of message."""

    channel: Channel
    direction: Direction
    kind: str
    seen: int
    per_second: float
    bytes: int


class Latency(NamedTuple):
    """How long one kind of answer took, in seconds, of all times."""

    what: str
    by: str
    """Whose answer it was: `client` or `server`."""
    times: int
    p50: float
    p99: float
    slowest: float


class End(NamedTuple):
    """One connection, and how far each side has ended it: `open`, `ended` or `reset`."""

    channel: Channel
    number: int
    client: str
    server: str


class Seen(NamedTuple):
    """All that is shown of a session."""

    now: float = 0.0
    """Seconds since the session began."""
    lines: tuple[KindStatistics, ...] = ()
    """Each kind of message that was seen, channel by channel, clients' first."""
    latencies: tuple[Latency, ...] = ()
    connections: tuple[End, ...] = ()
    """Of each channel those that are open, or else the newest."""
    counts: tuple[tuple[Channel, int], ...] = (("ipc", 0), ("msg", 0))
    """How many connections there were."""


@dataclass
class LiveSession:
    """Everything that is known of a session so far."""

    now: float = 0.0
    """Seconds since the session began, at the last entry or look."""
    seen_messages: int = 0
    _assembler: Assembler = field(default_factory=Assembler)
    _stopwatch: Stopwatch = field(default_factory=Stopwatch)
    _latencies: dict[tuple[str, str], Histogram] = field(default_factory=dict)
    _counts: Counter[Kind] = field(default_factory=Counter)
    _bytes: Counter[Kind] = field(default_factory=Counter)
    _recent: deque[tuple[float, Kind]] = field(default_factory=deque)
    _judged_at: int = 0
    _kept: list[Conversation] | None = None
    _kept_until: float = 0.0

    def feed(self, entry: Entry) -> None:
        """Take what crossed next."""
        self.now = max(self.now, entry.t)
        conversation, messages = self._assembler.feed(entry)
        for message in messages:
            self._count(conversation, message)
            for took in self._stopwatch.take(conversation, message):
                histogram = self._latencies.setdefault((took.what, took.by), Histogram())
                histogram.take(took.seconds)
        if self._kept is None and self.seen_messages >= MOST_JUDGED:
            self._kept, self._kept_until = self.so_far(), self.now
        if self._kept is not None:
            conversation.messages = []

    def seen(self) -> Seen:
        """What is to be shown now."""
        while self._recent and self._recent[0][0] < self.now - RATE_SECONDS:
            self._recent.popleft()
        rates = Counter(kind for _, kind in self._recent)
        span = min(RATE_SECONDS, max(self.now, 1e-3))
        channels: tuple[Channel, ...] = ("ipc", "msg")
        all_ = self._assembler.conversations
        return Seen(
            self.now,
            tuple(
                KindStatistics(*kind, count, rates[kind] / span, self._bytes[kind])
                for kind, count in sorted(self._counts.items())
            ),
            tuple(
                Latency(*of, it.count, it.quantile(0.50), it.quantile(0.99), it.slowest)
                for of, it in sorted(self._latencies.items())
            ),
            tuple(end for channel in channels for end in _ends(all_, channel)),
            tuple((name, sum(each.channel == name for each in all_)) for name in channels),
        )

    @property
    def is_due(self) -> bool:
        """Whether enough has come since the last judgement for another."""
        return self._kept is None and self.seen_messages >= max(1, GROWTH * self._judged_at)

    def so_far(self) -> list[Conversation]:
        """The conversations as they are now, to be judged wherever and whenever one likes."""
        self._judged_at = self.seen_messages
        return self._assembler.so_far() if self._kept is None else self._kept

    def judged(self) -> Audit:
        """What the session shows of both peers, so far."""
        found = audit_of(self.so_far())
        if self._kept is None:
            return found
        more = self.seen_messages - MOST_JUDGED
        line = f"{more:,} messages after {self._kept_until:.3f} s; `audit` judges a whole recording"
        return replace(found, left_over=(*found.left_over, line))

    def _count(self, conversation: Conversation, message: Message) -> None:
        kind = (conversation.channel, message.direction, _name(message))
        self.seen_messages += 1
        self._counts[kind] += 1
        self._bytes[kind] += len(message.packet.payload)
        self._recent.append((self.now, kind))


def _ends(conversations: list[Conversation], channel: Channel) -> list[End]:
    found = [_end(each) for each in conversations if each.channel == channel]
    return [end for end in found if "open" in end] or found[-1:]


def _end(conversation: Conversation) -> End:
    def state(direction: Direction) -> str:
        if direction in conversation.resets:
            return "reset"
        # A reset by the other side ends this one too.
        return "ended" if conversation.resets or direction in conversation.ended else "open"

    return End(conversation.channel, conversation.number, state("c2s"), state("s2c"))


def _name(message: Message) -> str:
    # Never its own word for itself: what a peer calls a message may hold anything.
    return message.kind or ("of an unknown type" if message.value is not None else "no message")
