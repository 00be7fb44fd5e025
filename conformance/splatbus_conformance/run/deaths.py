"""Which streams of a testee ended because its process did: it cannot have finished its packets."""

import math
from collections.abc import Iterable, Sequence

from splatbus_conformance.wire.conversation import Conversation
from splatbus_conformance.wire.recording import Direction, Entry


def note_deaths(
    recorded: Iterable[Conversation],
    entries: Sequence[Entry],
    testee: Direction,
    lives: Iterable[tuple[float, float]],
) -> None:
    """Mark the conversations that ended with a process.

    Args:
        recorded: the conversations of these entries.
        entries: all that crossed the wire.
        testee: the direction in which the testee sends.
        lives: when each of its processes began and when it was known to have ended, in the time
            of the entries; infinity for one that runs.
    """
    said = [entry.t for entry in entries if entry.dir == testee and entry.data]
    for born, ended in lives:
        if ended < math.inf:
            last_said = max((t for t in said if born <= t < ended), default=born)
            for conversation in recorded:
                if last_said <= conversation.ended.get(testee, -math.inf) < ended:
                    conversation.died.add(testee)
