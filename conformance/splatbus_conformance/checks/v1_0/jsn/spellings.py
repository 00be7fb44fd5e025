"""Checks that every spelling of a message is read, and every unknown member passed over, at either
end (spec 1.0 section 2.2).
"""

from contextlib import AbstractContextManager, nullcontext
from functools import partial

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import (
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    End,
    Needs,
    check,
)
from splatbus_conformance.checks.v1_0.jsn.clients_spellings import (
    Judge,
    judge_replies,
    of_announcements,
    of_replies,
)
from splatbus_conformance.checks.v1_0.jsn.servers_spellings import (
    of_poses,
    of_receipts,
    of_requests,
)
from splatbus_conformance.checks.v1_0.jsn.writers import (
    ALL,
    Spelling,
    odd_spelling,
    of_length,
    spelled,
    unknown_members,
    with_others,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.recording import Channel

Trial = ClientTrial | ServerTrial
ENDS: dict[End, Needs] = {
    CLIENT_IPC: OPENS_HOST_MEMORY,
    CLIENT_MSG: ("asks",),
    SERVER_IPC: ("1.1",),
    SERVER_MSG: (),
}
EFFECT = "memory is opened, frames released, requests answered, hello welcomed that are written so"
LENGTHS: tuple[int, ...] = (1 << 12, (1 << 16) + 1, LIMITS["max_payload_bytes"])
"""Of payloads in bytes: beyond what buffers hold that somebody thought large enough; the longest
last, so that what is smaller is known to be taken.
"""


def reading(trial: Trial, channel: Channel) -> AbstractContextManager[Judge]:
    """What judges the reading at this end."""
    if isinstance(trial, ClientTrial):
        return of_announcements(trial) if channel == "ipc" else of_replies(trial)
    return of_receipts(trial) if channel == "ipc" else of_requests(trial)


@check(
    "JSN-6",
    observable=EFFECT,
    on=ENDS,
    given=reading,
    cases={
        CLIENT_IPC: spelled(40, 4000),
        CLIENT_MSG: spelled(6, 30),
        SERVER_IPC: spelled(10, 300, ALL),
        SERVER_MSG: spelled(60, 2000, ALL),
    },
)
def check_takes_any_spelling(trial: Trial, channel: Channel, judge: Judge, case: Spelling) -> None:
    """Messages with members in any order, white space between all tokens, escapes in strings and
    names, numbers with fractions, exponents and many digits: welcome, init packets, frames and
    replies; hello, opened, release and requests.
    """
    judge(odd_spelling(case))


@check(
    "JSN-7",
    observable=EFFECT,
    on=ENDS,
    given=reading,
    cases={
        CLIENT_IPC: with_others(40, 4000),
        CLIENT_MSG: with_others(2, 30),
        SERVER_IPC: with_others(10, 300),
        SERVER_MSG: with_others(60, 2000),
    },
)
def check_ignores_unknown_members(trial: Trial, channel: Channel, judge: Judge, seed: int) -> None:
    """The same messages with unknown members at every level: odd names, names from other levels,
    values nested to the limit, a decoy of the message itself.
    """
    judge(unknown_members(trial, seed))


SHOWN = "a frame shows the camera of a pose that is written so"


@check(
    "JSN-6",
    observable=SHOWN,
    on={SERVER: ("frames",)},
    given=of_poses,
    cases=spelled(30, 1000, ALL),
)
def check_takes_any_spelling_of_poses(trial: ServerTrial, judge: Judge, case: Spelling) -> None:
    """The same of poses."""
    judge(odd_spelling(case))


@check(
    "JSN-7", observable=SHOWN, on={SERVER: ("frames",)}, given=of_poses, cases=with_others(30, 1000)
)
def check_ignores_unknown_members_of_poses(trial: ServerTrial, judge: Judge, seed: int) -> None:
    """The same of poses, at every level."""
    judge(unknown_members(trial, seed))


def reading_once(trial: ClientTrial, channel: Channel) -> AbstractContextManager[Judge]:
    """The same, but that what is long tells no time of requests: it is under way for a while."""
    if channel == "ipc":
        return of_announcements(trial)
    return nullcontext(partial(judge_replies, trial))


@check(
    "JSN-6",
    observable="the testee opens memory, releases frames, and goes on after replies",
    on={end: needs for end, needs in ENDS.items() if end.side == "client"},
    given=reading_once,
    cases=Cases(LENGTHS),
)
def check_takes_any_length(trial: Trial, channel: Channel, judge: Judge, length: int) -> None:
    """What a client is told, with white space that makes it as long as a payload may be."""
    judge(of_length(length))
