"""Which bytes of a recording a failure is about, for those who show it to people."""

import itertools
from collections.abc import Iterable, Iterator, Sequence

from splatbus_conformance.rules import Sighting, sightings
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry
from splatbus_conformance.wire.transcript import Mark, excerpt

MOST_CONNECTIONS = 64
DIRECTIONS: dict[str, Direction] = {"client": "c2s", "server": "s2c"}


def mark(sighting: Sighting) -> Mark | None:
    """Where the bytes stand that a rule saw a breach in; None if it saw it in what did not come."""
    if sighting.message:
        offset = sighting.message.packet.offset
        direction = sighting.message.direction
    elif sighting.data:
        offset, direction = sighting.offset, DIRECTIONS[sighting.peer]
    else:
        return None
    channel: Channel = "ipc" if sighting.channel == "ipc" else "msg"
    return Mark(channel, sighting.conn, direction, offset, sighting.pointer)


def shown(sighting: Sighting) -> tuple[str, ...]:
    """The bytes that a rule saw a breach in, as lines of a transcript; none if none came."""
    place = mark(sighting)
    if place is None:
        return ()
    data = packet(sighting.message.packet.payload) if sighting.message else sighting.data
    entry = Entry(sighting.t, place.channel, place.conn, place.dir, data)
    return tuple(excerpt([entry], 1, [place._replace(offset=0)]))


def marks(
    entries: Sequence[Entry], ours: Direction, requirement: str, since: int = 0
) -> list[Mark]:
    """What a check was about that failed: the last packet of ours, and the last of the testee's
    that a rule finds to break the same requirement.

    Where what we sent breaks the standard itself, that is the one which was meant to: the last of
    those, not what followed it to see whether the testee goes on.

    Args:
        entries: all that crossed the wire.
        ours: the direction in which the harness sends.
        requirement: what the check judges.
        since: the number of entries before the last case.
    """
    began = entries[since].t if since < len(entries) else 0.0
    breaches = [it for it in sightings(of_the_last_connections(entries)) if it.breach]
    breaches = [it for it in breaches if it.t >= began]
    hostile = _last(it for it in breaches if DIRECTIONS[it.peer] == ours)
    theirs = _last(
        it for it in breaches if DIRECTIONS[it.peer] != ours and it.requirement == requirement
    )
    sent = list(_sent(entries, ours))
    late = [it for place, it in sent if place >= since]
    last = next(reversed(late or [it for _, it in sent]), None)
    return [it for it in (hostile or last, theirs) if it]


def of_the_last_connections(entries: Sequence[Entry]) -> list[Entry]:
    """What crossed the last connections: a testee in a hot loop makes thousands, and rules compare
    each with all.
    """
    newest = dict.fromkeys((it.channel, it.conn) for it in reversed(entries))
    kept = set(itertools.islice(newest, MOST_CONNECTIONS))
    return [it for it in entries if (it.channel, it.conn) in kept]


def _last(found: Iterable[Sighting]) -> Mark | None:
    """The last that has a place; of several on one packet, one that points into it."""
    placed = [(it.t, bool(it.pointer), mark(it)) for it in found]
    return max((it for it in placed if it[2]), key=lambda it: it[:2], default=(0.0, False, None))[2]


def _sent(entries: Sequence[Entry], ours: Direction) -> Iterator[tuple[int, Mark]]:
    """Everything that was sent in this direction, with its place among the entries."""
    counts: dict[tuple[str, int], int] = {}
    for place, entry in enumerate(entries):
        if entry.dir == ours and entry.data:
            key = entry.channel, entry.conn
            offset = counts.get(key, 0)
            counts[key] = offset + len(entry.data)
            yield place, Mark(entry.channel, entry.conn, ours, offset)
