"""Checks on payloads of every length that there may be (spec 1.0 sections 2.1 and 2.2)."""

from collections.abc import Iterator

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.v1_0.jsn.clients_spellings import (
    Writer,
    judge_writers_on_ipc,
    judge_writers_on_msg,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.messages import Json, encode

LENGTHS: tuple[int, ...] = (1 << 12, (1 << 16) + 1, LIMITS["max_payload_bytes"])
"""Of payloads in bytes: beyond what buffers hold that somebody thought large enough."""


def of_length(length: int) -> Writer:
    """Writes messages with white space before their last brace, until they are so long."""

    def write(message: Json) -> bytes:
        return encode(message)[:-1].ljust(length - 1) + b"}"

    return write


def of_every_length(trial: ClientTrial) -> Iterator[Writer]:
    """The longest last, so that what is smaller is known to be taken."""
    return map(of_length, trial.each(LENGTHS))


@check(
    "JSN-6",
    observable="the testee opens memory and releases frames that are announced so",
    needs=OPENS_HOST_MEMORY,
)
def check_takes_any_length_on_ipc(trial: ClientTrial) -> None:
    """welcome, init packets and frames whose white space makes them as long as a payload may be."""
    judge_writers_on_ipc(trial, of_every_length(trial))


@check(
    "JSN-6",
    observable="the testee goes on after replies that are as long",
    needs=("asks",),
)
def check_takes_any_length_on_the_message_channel(trial: ClientTrial) -> None:
    """The same of welcome and of the replies to the first requests."""
    # What is so long is under way for a while: no time of the next request can be told from it.
    judge_writers_on_msg(trial, of_every_length(trial), asking_on=False)
