"""How long answers take: from a question as it crossed to its answer as it was first read.

What is paired is what both ends of the wire can see: a request and its reply, a `hello` and its
`welcome`, an init packet and what opening it came to, a `frame` and its `release`, a pose with a
tag and the first `frame` that shows it. Whoever records reads an answer late if it is busy, never
early, so that a latency may be less than what is said here, and not more.
"""

import math
from collections import deque
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from heapq import merge
from itertools import repeat
from typing import Any, NamedTuple

from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.message_kinds import REPLIES, REPLY_TO, REQUESTS

BINS_A_DECADE = 20
LEAST_SECONDS = 1e-6
"""What is faster counts as this: no clock that stamps recordings tells more."""
MOST_WAITING = 1000
"""Questions of one name, and names, that are kept while no answer comes."""

Name = tuple[Hashable, ...]
"""By what a question and its answer are known to belong together."""


@dataclass
class Histogram:
    """Durations, counted in bins of equal ratio."""

    counts: dict[int, int] = field(default_factory=dict)
    """By bin: n has what lies from 10^(n/20) to below 10^((n+1)/20) seconds."""
    slowest: float = 0.0

    def take(self, seconds: float) -> None:
        """Count one more."""
        number = math.floor(BINS_A_DECADE * math.log10(max(seconds, LEAST_SECONDS)))
        self.add(Histogram({number: 1}, seconds))

    def add(self, other: "Histogram") -> None:
        """Count what was measured elsewhere as well."""
        for number, count in other.counts.items():
            self.counts[number] = self.counts.get(number, 0) + count
        self.slowest = max(self.slowest, other.slowest)

    @property
    def count(self) -> int:
        """How many were counted."""
        return sum(self.counts.values())

    def quantile(self, share: float) -> float:
        """Seconds which this share of all did not exceed, within 6%: the middle of its bin, or the
        slowest itself.
        """
        rank, below = math.ceil(share * self.count), 0
        if rank == self.count:
            return self.slowest
        for number in sorted(self.counts):
            below += self.counts[number]
            if below >= rank:
                return min(_edge(number + 0.5), self.slowest)
        return 0.0

    def as_json(self) -> dict[str, Any]:
        """For reports, in seconds; empty bins are left out."""
        return {
            "count": self.count,
            "p50": _brief(self.quantile(0.50)),
            "p99": _brief(self.quantile(0.99)),
            "max": _brief(self.slowest),
            "bins": [
                [_brief(_edge(number)), _brief(_edge(number + 1)), self.counts[number]]
                for number in sorted(self.counts)
            ],
        }


Latencies = dict[str, Histogram]
"""By what was timed, such as `ping → pong`."""


class Took(NamedTuple):
    """One answer, and how long it took."""

    what: str
    by: str
    """Whose answer it was: `client` or `server`."""
    seconds: float


class Stopwatch:
    """Pairs questions with answers as they cross; messages have to come in order of time."""

    def __init__(self) -> None:
        self._waiting: dict[Name, deque[tuple[str, float]]] = {}

    def take(self, conversation: Conversation, message: Message) -> Iterator[Took]:
        """Take the message that crossed next; what it is the answer to, if it is one."""
        if message.value is None:
            return
        connection = (conversation.channel, conversation.number)
        name = _answers(connection, message)
        asked = self._waiting.get(name) if name else None
        if name and asked:
            what, since = asked.popleft()
            if not asked:
                del self._waiting[name]
            yield Took(
                f"{what} → {_word(message)}", message.sender, max(0.0, message.packet.ended - since)
            )
        if name := _asks(connection, message):
            if len(self._waiting) >= MOST_WAITING:
                self._waiting.pop(next(iter(self._waiting)))
            entry = (_word(message), message.packet.ended)
            # What names itself is asked anew; what does not is answered in order (REQ-7).
            fresh: deque[tuple[str, float]] = deque(maxlen=MOST_WAITING)
            if name[0] == "order":
                self._waiting.setdefault(name, fresh).append(entry)
            else:
                fresh.append(entry)
                self._waiting[name] = fresh


def of(conversations: Iterable[Conversation], side: str) -> Latencies:
    """How long this side took for its answers in a recording."""
    each_in_order = (zip(repeat(each), each.messages) for each in conversations)
    stopwatch, found = Stopwatch(), Latencies()
    for conversation, message in merge(*each_in_order, key=lambda it: it[1].packet.ended):
        for took in stopwatch.take(conversation, message):
            if took.by == side:
                found.setdefault(took.what, Histogram()).take(took.seconds)
    return found


def add(total: Latencies, more: Mapping[str, Histogram]) -> None:
    """Count what was measured elsewhere as well."""
    for what, histogram in more.items():
        total.setdefault(what, Histogram()).add(histogram)


def as_json(latencies: Mapping[str, Histogram]) -> list[dict[str, Any]]:
    """For reports (report.schema.json, `latencies`)."""
    return [{"what": what, **it.as_json()} for what, it in sorted(latencies.items())]


def _asks(connection: Name, message: Message) -> Name | None:
    """How the answer to a message will be known, if it is one that is answered."""
    value, kind = message.value or {}, message.kind
    if kind in REQUESTS:
        return _by_id(connection, value) or ("order", connection, REPLY_TO[kind])
    if kind == "hello":
        return ("welcome", connection)
    if kind == "init_packet" and (generation := whole(value.get("generation"))) is not None:
        return ("opening", connection, generation)
    if kind == "frame":
        return ("release", connection, whole(value.get("generation")), whole(value.get("seq")))
    if kind == "camera_pose" and isinstance(tag := value.get("tag"), str):
        return ("tag", tag)
    return None


def _answers(connection: Name, message: Message) -> Name | None:
    """How the question to a message is known, if it is an answer."""
    value, kind = message.value or {}, message.kind
    if kind in REPLIES:
        return _by_id(connection, value) or ("order", connection, kind)
    if kind == "error":
        return _by_id(connection, value)
    if kind == "welcome":
        return ("welcome", connection)
    if kind in ("opened", "open_failed"):
        return ("opening", connection, whole(value.get("generation")))
    if kind == "release":
        return ("release", connection, whole(value.get("generation")), whole(value.get("seq")))
    if kind == "frame" and isinstance(camera := value.get("camera"), dict):
        tag = camera.get("tag")
        return ("tag", tag) if isinstance(tag, str) else None
    return None


def _by_id(connection: Name, value: dict[str, Any]) -> Name | None:
    id = value.get("id")
    if not isinstance(id, str):
        id = whole(id)
    return None if id is None else ("id", connection, id)


def _word(message: Message) -> str:
    return (message.kind or "").replace("init_packet", "init packet")


def _edge(number: float) -> float:
    edge: float = 10.0 ** (number / BINS_A_DECADE)
    return edge


def _brief(seconds: float) -> float:
    return float(f"{seconds:.4g}")
