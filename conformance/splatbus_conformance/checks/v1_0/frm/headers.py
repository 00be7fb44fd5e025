"""A header that announces no payload that there may be (spec 1.0 section 2.1)."""

from typing import NamedTuple

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import CLIENT_IPC, CLIENT_MSG, SERVER_IPC, SERVER_MSG, Cases, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.exchange import exchange
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel

MOST: int = LIMITS["max_payload_bytes"]
HTTP = int.from_bytes(b"GET ", "little")


class BadHeader(NamedTuple):
    """Such a header, and what stands around it."""

    length: int
    later: bool = False
    """Once the testee has taken a packet on the connection, not first."""
    follows: str = "nothing"
    """Or `a good packet`, or as much as it `announces`."""
    behind: bool = False
    """It comes right behind a good packet."""

    def __str__(self) -> str:
        place = " on a connection that was in use" if self.later else ""
        place += " behind a good packet" if self.behind else ""
        return f"a header that announces {self.length:,} bytes{place}, and {self.follows} behind it"


EXTREME = (0, MOST + 1, 0xFFFF_FFFF)
SWAPPED = (28 << 24, 1 << 24)
"""Lengths that are good when their bytes are read from the other end."""
OTHERS = (HTTP, 2**31 - 1, 2**31, 0xFFFF_FF00)
FIRST = (
    *(BadHeader(length) for length in (*EXTREME, *SWAPPED, *OTHERS)),
    *(BadHeader(length, follows="a good packet") for length in (*EXTREME, *SWAPPED)),
    BadHeader(MOST + 1, follows="as much as it announces"),
)
LATER = tuple(BadHeader(length, later=True) for length in (*EXTREME, *SWAPPED, *OTHERS))
BAD_HEADERS = (*FIRST, *LATER)
TO_CLIENTS = tuple(it for it in FIRST if it.follows == "nothing")
"""In place of a reply, of which a client waits for no later one."""
TOO_LONG = encode({"type": "weather_report"}).ljust(MOST + 1)
LENGTHS = st.integers(MOST + 1, 0xFFFF_FFFF)
DRAWN = st.tuples(LENGTHS, st.booleans(), st.just("a good packet"))


def kind_of(header: BadHeader) -> object:
    """What is too extreme, or too near to what is right, to stand for another."""
    if header.later or header.behind or header.follows == "as much as it announces":
        return header.follows, header.behind
    return header.length if header.length in EXTREME else header.length in SWAPPED


@check(
    "FRM-3",
    observable="the end of the connection, and that the testee is there for another",
    on={CLIENT_IPC: ("ipc",), CLIENT_MSG: ("asks",), SERVER_IPC: (), SERVER_MSG: ()},
    cases={
        CLIENT_IPC: Cases(BAD_HEADERS, kind=kind_of),
        CLIENT_MSG: Cases(TO_CLIENTS, kind=kind_of),
        SERVER_IPC: Cases(BAD_HEADERS, DRAWN, kind_of, spare=4, quick=2, full=60),
        SERVER_MSG: Cases(
            (*BAD_HEADERS, BadHeader(0, behind=True)), DRAWN, kind_of, spare=4, quick=2, full=60
        ),
    },
    may_crash=True,
)
def check_bad_length_closes(
    trial: ClientTrial | ServerTrial, channel: Channel, case: BadHeader
) -> None:
    """A header that announces nothing, or more than the limit, in place of the first packet, or of
    a later one; alone, followed by a good packet, and by as many bytes as it announces.
    """
    bad = BadHeader(*case)
    it = exchange(trial, channel, bad.later)
    if it is None:
        return
    good = b"".join(packet(encode(message)) for message in it.awaited)
    follows = {"nothing": b"", "a good packet": good, "as much as it announces": TOO_LONG}
    header = bad.length.to_bytes(4, "little")
    it.connection.send((good if bad.behind else b"") + header + follows[bad.follows])
    outcome = trial.end_of(it.connection)
    if it.answers() > (len(it.awaited) if bad.behind else 0):
        outcome = "replies"
    trial.judge(outcome, f"{bad}, on the {channel} channel")
