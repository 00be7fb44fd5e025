"""Whether a client reads what a writer writes (spec 1.0 section 2.2)."""

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.spelling import ODD_TEXT
from splatbus_conformance.checks.v1_0.jsn.writers import Writer, noting
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.asking import asking
from splatbus_conformance.trials.moves.exchanges.reading import (
    TIMES_AGAIN,
    answer_all,
    asks_again_and_again,
    outcome_of_reading,
    wait_for_all,
)
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_reading import shorten

Judge = Callable[[Writer], None]
"""Judges whether what this writes is read."""
ODD_NAME = (ODD_TEXT * LIMITS["max_name_chars"])[: LIMITS["max_name_chars"]]
ODDLY_NAMED = {"name": ODD_NAME, "version": ODD_NAME[::-1]}
ROWS_ON_A_CONNECTION = 10
AT_ONCE = 8
"""Init packets in a row."""


@contextmanager
def of_announcements(trial: ClientTrial) -> Iterator[Judge]:
    """Of welcome, init packets and frames, each of which must have its effect.

    The full profile sends several init packets at once, so that a testee that looks for frames
    only now and then answers them all at one look.
    """
    trial.role.offers_memory = False
    trial.role.server = ODDLY_NAMED
    most = AT_ONCE if trial.thorough and "reinit" in trial.facts.capabilities() else 1
    row: list[Writer] = []
    rows = itertools.count()

    def judge_row() -> None:
        _judge_row(trial, row, anew=next(rows) % ROWS_ON_A_CONNECTION == 0)
        row.clear()

    def judge(writer: Writer) -> None:
        row.append(writer)
        if len(row) == most:
            judge_row()

    yield judge
    if row:
        judge_row()


def _judge_row(trial: ClientTrial, row: list[Writer], *, anew: bool) -> None:
    written: list[bytes] = []
    trial.role.encode["ipc"] = noting(row[0], written)
    connection = trial.greeted("ipc") if anew else trial.for_init_packet()
    dealings = trial.role.with_(connection)
    offered: dict[int, bytes] = {}
    for writer in row:
        trial.role.encode["ipc"] = noting(writer, written)
        trial.role.offer(connection, trial.role.init_packet(connection))
        offered[dealings.generation] = written[-1]
    # To open late is to be busy, perhaps with a long message: no sentence limits that.
    taken = trial.opens(connection, trial.patience) and (
        not dealings.frames or trial.releases(connection, dealings.frames[-1], trial.patience)
    )
    refused = [offered[it] for it in offered if it not in dealings.opened]
    outcome = trial.fate() or ("closes" if connection.ended else "ignores")
    text = (refused or written[-1:])[0].decode()
    trial.judge(
        "accepts" if taken and not refused else outcome,
        f"the message {shorten(text, 400)!r} on the IPC channel",
    )
    trial.delivered += len(row)


@contextmanager
def of_replies(trial: ClientTrial) -> Iterator[Judge]:
    """Of welcome and a reply to each request; the testee must go on, and ask again after the size
    [0,0] and all else, where it does so after plain replies.
    """
    asks_on = cache(lambda: asks_again_and_again(trial))
    yield lambda writer: judge_replies(trial, writer, TIMES_AGAIN if asks_on() else 0)


def judge_replies(trial: ClientTrial, writer: Writer, times: int = 0) -> None:
    """The same; it has to ask again so many times."""
    trial.role.server = ODDLY_NAMED
    written: list[bytes] = []
    trial.role.encode["msg"] = noting(writer, written)
    connection = asking(trial)
    answer_all(trial, connection)
    read = wait_for_all(trial, connection, times) or not times
    # Poses go on for a while even if reading does not.
    trial.ends(connection, REACTION_SECONDS)
    outcome = outcome_of_reading(trial, connection)
    last = shorten(written[-1].decode(), 400) if written else ""
    what = f"{len(written)} messages on the message channel, the last {last!r}"
    trial.judge("accepts" if outcome == "ignores" and read else outcome, what)
