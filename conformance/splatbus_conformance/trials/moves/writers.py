"""Writers, each of which writes messages in a way that all must read (JSN-6, JSN-7)."""

import itertools
from collections.abc import Callable, Iterator
from random import Random

from hypothesis import strategies as st

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.spelling import LIBERTIES, Plain, spell, spell_in_utf_8
from splatbus_conformance.cases.valid.unknown_members import (
    between_unknown_members,
    with_unknown_members,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import Trial
from splatbus_conformance.wire.conversation import MOST_VALUES
from splatbus_conformance.wire.messages import Json, encode

Writer = Callable[[Json], bytes]
Spelling = tuple[int, list[str]]
"""A seed, and the liberties that are taken."""
SEEDS = st.integers(0, 2**32 - 1)
ALL = st.just(list(LIBERTIES))
MOST_OFTEN_ALL = ALL | st.sampled_from(
    [list(it) for n in (1, 2, 3) for it in itertools.combinations(LIBERTIES, n)]
)
"""Liberties to take."""
AROUND = -1
"""In place of a seed: unknown members stand before and behind the others, as many as may be."""


def odd_spelling(case: Spelling) -> Writer:
    """Writes messages as RFC 8259 allows; the size plainly, for REQ-3 asks for that."""
    seed, liberties = case
    random = Random(seed)

    def write(message: Json) -> bytes:
        if "viewport_size" in message:
            message = message | {"viewport_size": [Plain(n) for n in message["viewport_size"]]}
        return spell(message, random, liberties).encode()

    return write


def unknown_members(trial: Trial, seed: int) -> Writer:
    """Writes messages with members that nobody knows, their characters escaped or not."""
    if seed == AROUND:
        most = MOST_VALUES["s2c" if isinstance(trial, ClientTrial) else "c2s"]
        return lambda message: encode(between_unknown_members(message, most))
    random = Random(seed)
    write = random.choice((encode, spell_in_utf_8))
    return lambda message: write(with_unknown_members(message, random))


def of_length(length: int) -> Writer:
    """Writes messages with white space before their last brace, until they are so long."""
    return lambda message: encode(message)[:-1].ljust(length - 1) + b"}"


def noting(write: Writer, written: list[bytes]) -> Writer:
    """The same writer; what it writes is noted."""

    def write_and_note(message: Json) -> bytes:
        written.append(write(message))
        return written[-1]

    return write_and_note


def with_less(case: Spelling) -> Iterator[Spelling]:
    """The same with a liberty less."""
    seed, liberties = case
    return ((seed, fewer) for fewer in without_one(liberties) if fewer)


def spellings(trial: ClientTrial, quick: int, full: int) -> Iterator[Spelling]:
    """Drawn spellings, one after the other."""
    drawn = st.tuples(SEEDS, MOST_OFTEN_ALL)
    return trial.each(drawn=drawn, quick=quick, full=full, simpler=with_less)
