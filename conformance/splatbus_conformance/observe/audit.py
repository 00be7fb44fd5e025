"""Audit: judge a recorded session by what its bytes show of either peer (L0)."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from splatbus_schemas.requirements import Requirement, requirements

from splatbus_conformance.rules import Sighting, guilty, judge
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.rules.v1_0.jsn import TEXT
from splatbus_conformance.verdicts import Level, Result, Verdict, failing
from splatbus_conformance.wire.capture import Capture
from splatbus_conformance.wire.conversation import SENDER, Conversation, conversations
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.redaction import redacted

VERSIONS = ("1.0", "1.1")
"""Rules of 1.1 judge only what a `hello` or an init packet of 1.1 has brought into play."""
OF_ONE_MESSAGE = {*TEXT, "POS-1", "POS-2", "POS-3", "POS-4", "POS-8", "REQ-1", "REQ-2"}
"""What a message shows whatever was said before it."""


@dataclass(frozen=True)
class RecordingPlace:
    """Where in a recording something stands."""

    channel: str
    conn: int
    t: float
    """Seconds since the recording began."""
    sender: str
    """Whose stream it stands in."""
    offset: int
    """Byte of that stream at which the packet begins, its header included."""
    pointer: str
    """JSON Pointer into the message, empty where the breach has no place of its own there."""

    def __str__(self) -> str:
        where = f"{self.channel} #{self.conn}, {self.t:.4f} s, byte {self.offset} of the "
        return f"{where}{self.sender}'s stream" + (f", {self.pointer}" if self.pointer else "")


@dataclass(frozen=True)
class RecordedBreach:
    """How a requirement was broken, and the bytes that show it."""

    place: RecordingPlace
    text: str
    excerpt: str
    """The bytes as lines of a transcript, around the member that matters; folded when long."""
    code: str = ""
    """Which of the ways to break it this is."""


@dataclass(frozen=True)
class AuditFinding:
    """What a recording shows of one requirement and one peer."""

    requirement: Requirement
    peer: str
    exercised: int
    """How often the peer met the requirement or broke it."""
    broken: int
    first: RecordedBreach | None
    """The first breach, if there is one."""

    @property
    def verdict(self) -> Verdict:
        """Pass, or by the level of the requirement fail or warn."""
        return failing(self.requirement.level) if self.broken else Verdict.PASS


@dataclass(frozen=True)
class Audit:
    """What a recording shows."""

    findings: tuple[AuditFinding, ...]
    """What was exercised, in the order of the specification, the client's before the server's."""
    conversations: tuple[Conversation, ...]
    """What was judged."""
    left_over: tuple[str, ...]
    """What no rule could judge, in words."""
    loose: tuple[Conversation, ...] = ()
    """Connections of which a capture lacks something, and what came behind it."""

    @property
    def connections(self) -> Mapping[Channel, int]:
        """How many connections were seen on each channel."""
        channels: tuple[Channel, ...] = ("ipc", "msg")
        seen = {(it.channel, it.number) for it in (*self.conversations, *self.loose)}
        return {name: sum(channel == name for channel, _ in seen) for name in channels}

    @property
    def seconds(self) -> float:
        """How long the session lasted."""
        times = [
            t
            for it in (*self.conversations, *self.loose)
            for t in (it.opened, *(m.packet.ended for m in it.messages), *it.ended.values())
        ]
        return max(times, default=0.0) - min(times, default=0.0)

    def version(self, peer: str) -> str:
        """The version of the specification that `client` or `server` has come to be judged by."""
        first = requirements(VERSIONS[0])
        added = any(finding.requirement.id not in first for finding in self.of(peer))
        return VERSIONS[added]

    def of(self, peer: str) -> tuple[AuditFinding, ...]:
        """The findings on `client` or `server`."""
        return tuple(finding for finding in self.findings if finding.peer == peer)


def audit(entries: Iterable[Entry]) -> Audit:
    """Judge a recording by every rule; never raises for what it holds."""
    return audit_of(conversations(redacted(entries), shelved=True))


def audit_of(found: Sequence[Conversation]) -> Audit:
    """Judge what was recorded so far, put together already."""
    return _audit(found, judge(found))


def audit_capture(capture: Capture) -> Audit:
    """Judge what a capture holds; nobody is blamed for what it lacks."""
    whole = [each for entries in capture.sessions for each in conversations(redacted(entries))]
    loose = conversations(capture.messages)
    of_one = (each for each in judge(loose) if each.requirement in OF_ONE_MESSAGE)
    judged = _audit(whole, chain(judge(whole), of_one))
    return replace(judged, left_over=(*capture.left_over, *judged.left_over), loose=tuple(loose))


def _audit(found: Sequence[Conversation], seen: Iterable[Sighting]) -> Audit:
    known = requirements(VERSIONS[-1])
    counts: dict[tuple[str, str], _Count] = {}
    for sighting in seen:
        counts.setdefault((sighting.requirement, sighting.peer), _Count()).take(sighting)
    return Audit(
        tuple(
            _finding(requirement, peer, counts[name, peer])
            for name, requirement in known.items()
            for peer in ("client", "server")
            if (name, peer) in counts
        ),
        tuple(found),
        tuple(line for conversation in found for line in _left_over(conversation)),
    )


def results(judged: Audit, peer: str) -> list[Result]:
    """The findings on `client` or `server` as results for a report."""
    return [
        Result(
            finding.requirement.id,
            "rule",
            Level.PASSIVE,
            finding.verdict,
            _in_words(finding),
            (str(finding.first.place), *finding.first.excerpt.splitlines())
            if finding.first
            else (),
            code=finding.first.code if finding.first else "",
        )
        for finding in judged.of(peer)
    ]


@dataclass
class _Count:
    """What was seen of one requirement and one peer: of a long session too much to be kept."""

    seen: int = 0
    broken: int = 0
    first: Sighting | None = None

    def take(self, sighting: Sighting) -> None:
        self.seen += 1
        if sighting.breach is not None:
            self.broken += 1
            if self.first is None or sighting.t < self.first.t:
                self.first = sighting


def _finding(requirement: Requirement, peer: str, count: _Count) -> AuditFinding:
    first = None if count.first is None else _breach(count.first)
    return AuditFinding(requirement, peer, count.seen, count.broken, first)


def _breach(sighting: Sighting) -> RecordedBreach:
    assert sighting.breach is not None
    message = sighting.message
    place = RecordingPlace(
        sighting.channel,
        sighting.conn,
        sighting.t,
        sighting.peer if message is None else message.sender,
        sighting.offset if message is None else message.packet.offset,
        sighting.pointer,
    )
    _, *lines = guilty.shown(sighting) or [""]
    return RecordedBreach(place, sighting.breach.words, "\n".join(lines), sighting.breach.code)


def _in_words(finding: AuditFinding) -> str:
    if finding.first is None:
        return f"held {finding.exercised} times of {finding.exercised}"
    times = f"broken {finding.broken} times of {finding.exercised}"
    return f"{times}; first: {finding.first.text}"


def _left_over(conversation: Conversation) -> Iterator[str]:
    where = f"{conversation.channel} #{conversation.number}"
    for direction, stream in conversation.streams.items():
        if stream.refused is not None:
            count = len(stream.rest) + stream.unsplit
            yield f"{where}: {count:,} bytes of the {SENDER[direction]} from a bad header on"
        elif stream.rest:
            yield f"{where}: {len(stream.rest):,} bytes of the {SENDER[direction]}, no whole packet"
    unknown = sum(m.kind is None and m.value is not None for m in conversation.messages)
    if unknown:
        yield f"{where}: {unknown} messages of unknown types"
    if unanswered := exchanges(conversation).unanswered:
        yield f"{where}: {len(unanswered)} requests without a reply"
