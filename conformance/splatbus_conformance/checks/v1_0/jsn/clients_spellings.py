"""Checks that every spelling of a message is read, and every unknown member passed over."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from random import Random

from hypothesis import strategies as st

from splatbus_conformance.cases.shrinking import without_one
from splatbus_conformance.cases.valid.spelling import (
    LIBERTIES,
    ODD_TEXT,
    Plain,
    spell,
    spell_in_utf_8,
)
from splatbus_conformance.cases.valid.unknown_members import (
    between_unknown_members,
    with_unknown_members,
)
from splatbus_conformance.checks import OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.v1_0.req.clients import (
    TIMES_AGAIN,
    answer_all,
    asks_again_and_again,
    outcome_of_reading,
    wait_for_all,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.messages import Json, encode

Writer = Callable[[Json], bytes]
Spelling = tuple[int, list[str]]
"""A seed, and the liberties that are taken."""
ROWS_ON_A_CONNECTION = 10
AT_ONCE = 8
"""Init packets in a row."""
AROUND = -1
"""In place of a seed: the unknown members stand before and behind the others."""


def odd_spelling(case: Spelling) -> Writer:
    """Writes messages as RFC 8259 allows; the size plainly, for REQ-3 asks for that."""
    seed, liberties = case
    random = Random(seed)

    def write(message: Json) -> bytes:
        if "viewport_size" in message:
            message = message | {"viewport_size": [Plain(n) for n in message["viewport_size"]]}
        return spell(message, random, liberties).encode()

    return write


def unknown_members(seed: int) -> Writer:
    """Writes messages with members that nobody knows, their characters escaped or not."""
    if seed == AROUND:
        return lambda message: encode(between_unknown_members(message))
    random = Random(seed)
    write = random.choice((encode, spell_in_utf_8))
    return lambda message: write(with_unknown_members(message, random))


def spellings(trial: ClientTrial, quick: int, full: int) -> Iterator[Spelling]:
    """Drawn spellings, most of them with all liberties."""
    some = [list(it) for n in (1, 2, 3) for it in itertools.combinations(LIBERTIES, n)]
    drawn = st.tuples(st.integers(0, 2**32 - 1), st.just(list(LIBERTIES)) | st.sampled_from(some))

    def simpler(case: Spelling) -> Iterator[Spelling]:
        seed, liberties = case
        return ((seed, fewer) for fewer in without_one(liberties) if fewer)

    return trial.each(drawn=drawn, quick=quick, full=full, simpler=simpler)


def judge_writers_on_ipc(trial: ClientTrial, writers: Iterator[Writer]) -> None:
    """Write welcome, init packets and frames so; each must have its effect.

    The full profile sends several init packets at once, so that a testee that looks for frames
    only now and then answers them all at one look.
    """
    trial.role.offers_memory = False
    trial.role.server = {"name": ODD_TEXT, "version": ODD_TEXT[::-1]}
    several = trial.thorough and "reinit" in trial.facts.capabilities()
    for number in itertools.count():
        row = list(itertools.islice(writers, AT_ONCE if several else 1))
        if not row:
            break
        written: list[bytes] = []

        def keep(payload: bytes) -> bytes:
            written.append(payload)  # noqa: B023 - the closures end with the round
            return payload

        trial.role.encode["ipc"] = lambda message: keep(row[0](message))  # noqa: B023
        anew = number % ROWS_ON_A_CONNECTION == 0
        connection = trial.greeted("ipc") if anew else trial.for_init_packet()
        dealings = trial.role.with_(connection)
        offered: dict[int, bytes] = {}
        for writer in row:
            trial.role.encode["ipc"] = lambda message: keep(writer(message))  # noqa: B023
            trial.role.offer(connection, trial.role.init_packet(connection))
            offered[dealings.generation] = written[-1]
        # To open late is to be busy, perhaps with a long message: no sentence limits that.
        taken = trial.opens(connection, trial.patience) and (
            not dealings.frames or trial.releases(connection, dealings.frames[-1], trial.patience)
        )
        refused = [offered[it] for it in offered if it not in dealings.opened]
        outcome = trial.fate() or ("closes" if connection.ended else "ignores")
        outcome = "accepts" if taken and not refused else outcome
        text = (refused or written[-1:])[0].decode()
        trial.judge(outcome, f"the message {shorten(text, 400)!r} on the IPC channel")
        trial.delivered += len(row)


def judge_writers_on_msg(
    trial: ClientTrial, writers: Iterable[Writer], *, asking_on: bool = True
) -> None:
    """Write welcome and replies so, to a request each; the testee must go on, and if `asking_on`,
    ask again after the size [0,0] and all else, where it does so after plain replies.
    """
    times = TIMES_AGAIN if asking_on and asks_again_and_again(trial) else 0
    trial.role.server = {"name": ODD_TEXT, "version": ODD_TEXT[::-1]}
    for writer in writers:
        written: list[bytes] = []

        def encode_and_keep(message: Json) -> bytes:
            written.append(writer(message))  # noqa: B023 - the closures end with the round
            return written[-1]  # noqa: B023

        trial.role.encode["msg"] = encode_and_keep
        connection = asking(trial)
        answer_all(trial, connection)
        read = wait_for_all(trial, connection, times) or not times
        # Poses go on for a while even if reading does not.
        trial.ends(connection, REACTION_SECONDS)
        outcome = outcome_of_reading(trial, connection)
        last = shorten(written[-1].decode(), 400) if written else ""
        what = f"{len(written)} messages on the message channel, the last {last!r}"
        trial.judge("accepts" if outcome == "ignores" and read else outcome, what)


@check(
    "JSN-6",
    observable="the testee opens memory and releases frames that are announced so",
    needs=OPENS_HOST_MEMORY,
)
def check_takes_any_spelling_on_ipc(trial: ClientTrial) -> None:
    """welcome, init packets and frames with members in any order, white space between all tokens,
    escapes in strings and names, numbers with fractions, exponents and many digits.
    """
    judge_writers_on_ipc(trial, map(odd_spelling, spellings(trial, quick=40, full=4000)))


@check(
    "JSN-6",
    observable="the testee goes on after replies that are spelled so",
    needs=("asks",),
)
def check_takes_any_spelling_on_the_message_channel(trial: ClientTrial) -> None:
    """The same of welcome and of the replies to the first requests."""
    judge_writers_on_msg(trial, map(odd_spelling, spellings(trial, quick=6, full=30)))


@check(
    "JSN-7",
    observable="the testee opens memory and releases frames that are announced so",
    needs=OPENS_HOST_MEMORY,
)
def check_ignores_unknown_members_on_ipc(trial: ClientTrial) -> None:
    """welcome, init packets and frames with unknown members at every level: odd names, names from
    other levels, values nested to the limit, a decoy of the message itself.
    """
    seeds = trial.each([AROUND], st.integers(0, 2**32 - 1), quick=40, full=4000)
    judge_writers_on_ipc(trial, map(unknown_members, seeds))


@check(
    "JSN-7",
    observable="the testee goes on after replies that have such members",
    needs=("asks",),
)
def check_ignores_unknown_members_on_the_message_channel(trial: ClientTrial) -> None:
    """The same of welcome and of the replies to the first requests."""
    seeds = trial.each([AROUND], st.integers(0, 2**32 - 1), quick=2, full=30)
    judge_writers_on_msg(trial, map(unknown_members, seeds))
