"""Packets that arrive in pieces, and joined (spec 1.0 section 2.1)."""

import itertools
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from hypothesis import strategies as st

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.spelling import spell_in_utf_8
from splatbus_conformance.checks import (
    CLIENT,
    CLIENT_IPC,
    CLIENT_MSG,
    DECLARES_HOST_MEMORY,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.exchange import exchange
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import Json, welcome
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

APART_SECONDS = 0.003
"""Between two pieces, so that TCP does not join them."""
NOTE = {"note": "né 🙂 à Zürich – 東京\u2028"}
"""A member that nobody knows, whose text has characters of two, three and four bytes."""
SLOW_SECONDS = 1.5
"""Longer than all pieces take where the harness is not kept waiting."""
LONGEST = 1000
MANY = LONGEST // 10
"""Pieces between which there is no pause."""
PLACES: dict[str, Callable[[bytes], Iterable[int]]] = {
    "nowhere": lambda data: (),
    "at every byte": lambda data: range(1, len(data)),
    "in the header": lambda data: range(1, 7),
    "inside characters": lambda data: (n for n, byte in enumerate(data) if byte & 0xC0 == 0x80),
    "inside escapes": lambda data: (n for n in range(1, len(data)) if data[n - 1 : n] == b"\\"),
}


class Cuts(NamedTuple):
    """How a stream is cut."""

    where: str | list[int]
    """A name of `PLACES`, or places."""
    pause: float = APART_SECONDS
    """At each cut, in seconds; without any TCP joins what was cut."""
    later: bool = False
    """Not the first that the testee takes on its connection, but what comes after that."""

    def __str__(self) -> str:
        place = ", on a connection that was in use" if self.later else ""
        return f"cut {self.where}, {1000 * self.pause:g} ms apart{place}"


FIRST: list[Any] = [Cuts(name) for name in PLACES]
NAMED = [*FIRST, *(it._replace(later=True) for it in FIRST)]
PAUSES = st.sampled_from((0.0, 0.0005, APART_SECONDS, 0.02))
SOMEWHERE = st.lists(st.integers(1, LONGEST), max_size=6).map(sorted)
DRAWN_FIRST: st.SearchStrategy[Any] = st.tuples(SOMEWHERE, PAUSES)
DRAWN: st.SearchStrategy[Any] = st.tuples(SOMEWHERE, PAUSES, st.booleans())


def fewer(case: Any) -> Iterator[Cuts]:
    """The same with a cut less."""
    cuts = Cuts(*case)
    listed = [] if isinstance(cuts.where, str) else cuts.where
    return (cuts._replace(where=where) for where in without_one(listed))


def in_utf_8(message: Json) -> bytes:
    """A packet with a member that nobody knows, whose characters are not escaped."""
    return packet(spell_in_utf_8(message | NOTE))


def send_cut(
    trial: ClientTrial | ServerTrial, connection: Connection, data: bytes, cuts: Cuts
) -> None:
    """Send bytes in pieces; between very many there are no pauses.

    Skips the check if a busy machine makes them last so long that the testee gives them up.
    """
    began = time.monotonic()
    places = PLACES[cuts.where](data) if isinstance(cuts.where, str) else cuts.where
    ends = sorted({place for place in places if 0 < place < len(data)})
    for begin, end in itertools.pairwise([0, *ends, len(data)]):
        connection.send(data[begin:end])
        trial.rest(cuts.pause if len(ends) < MANY else 0.0)
    lasted = (connection.gone_since or began) - began
    if connection.ended and lasted > SLOW_SECONDS:
        trial.not_observable(f"on a busy machine the pieces took {lasted:.1f} s, until it closed")


@check(
    "FRM-4",
    observable="memory is opened, frames released, requests answered that arrive in pieces",
    on={
        CLIENT_IPC: DECLARES_HOST_MEMORY,
        CLIENT_MSG: ("asks",),
        SERVER_IPC: ("1.1",),
        SERVER_MSG: (),
    },
    cases={
        CLIENT_IPC: Cases(NAMED, DRAWN, quick=40, full=2000, simpler=fewer),
        CLIENT_MSG: Cases(FIRST, DRAWN_FIRST, quick=3, full=60, simpler=fewer),
        SERVER_IPC: Cases(FIRST, DRAWN_FIRST, quick=10, full=300, simpler=fewer),
        SERVER_MSG: Cases(NAMED, DRAWN, quick=40, full=1000, simpler=fewer),
    },
)
def check_any_segmentation(trial: ClientTrial | ServerTrial, channel: Channel, case: Cuts) -> None:
    """What the testee awaits first on a connection, and what it awaits later, arrives byte by byte,
    cut in the header, inside characters of more than one byte, inside escapes, and anywhere; and
    joined to other packets.
    """
    cuts = Cuts(*case)
    it = exchange(trial, channel, cuts.later)
    if it is None or not it.awaited:
        return
    data = b"".join(map(in_utf_8, it.awaited))
    send_cut(trial, it.connection, data, cuts)
    taken = it.taken()
    what = f"{len(it.awaited)} packets of {len(data)} bytes, {cuts}, on the {channel} channel"
    trial.expect(taken is not False, "not-taken", f"{what}: they were not taken, each once")
    if taken is None and not isinstance(cuts.where, str):  # it can show no more than with these
        trial.not_observable(
            "the testee asks for nothing more after a reply: nothing shows reading"
        )
    trial.delivered += bool(taken)


@check(
    "FRM-4",
    observable="the testee obeys NEG-16 on a welcome that arrived in pieces",
    on={CLIENT: ("hello:msg", "returns:msg")},
)
def check_any_segmentation_of_welcome(trial: ClientTrial) -> None:
    """A welcome with a version that nobody listed, on which the testee must close the connection,
    is cut as above; it is first seen to do so where the welcome is whole.
    """
    trial.role.welcomes = False
    data = in_utf_8(welcome("msg", [], "9.9"))
    cases = trial.each(FIRST[1:], DRAWN_FIRST, quick=2, full=10, simpler=fewer)
    for case in itertools.chain(FIRST[:1], cases):
        cuts = Cuts(*case)
        connection = trial.connection("msg")
        if not trial.says_hello(connection) or connection.ended:
            trial.not_observable("the testee said no hello on the msg channel, or closed by itself")
        send_cut(trial, connection, data, cuts)
        closes = trial.ends(connection)
        if cuts.where == "nowhere" and not closes:
            trial.not_observable("the testee does not close on a version that it did not list")
        leaves = closes and trial.facts.leaves and trial.fate() == "exits"
        outcome = (None if leaves else trial.fate()) or ("accepts" if closes else "hangs")
        trial.judge(outcome, f"a welcome of {len(data)} bytes, {cuts}")
        trial.delivered += cuts.where != "nowhere"
        trial.reassure("msg")
