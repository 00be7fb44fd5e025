"""What follows text that breaks a rule, at either end (spec 1.0 section 2.2)."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.checks import (
    CLIENT_IPC,
    CLIENT_MSG,
    OPENS_HOST_MEMORY,
    SERVER_IPC,
    SERVER_MSG,
    Cases,
    check,
)
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.exchange import in_use
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel

SPARE = 12
"""Broken texts that the quick profile delivers beside one of each kind, where each takes long."""
CLOSING_SECONDS = 0.03
"""For a testee to close on such a text, before what follows is sent."""
Trial = ClientTrial | ServerTrial
Row = Sequence[BrokenText]
TEXTS = broken_texts({"type": "weather_report", "sunny": True})
ALONE: list[Row] = [[text] for text in TEXTS]
ROWS = [*ALONE, *(TEXTS[place : place + 3] for place in range(0, len(TEXTS), 3))]


def named(row: Row) -> str:
    """What is wrong with texts."""
    return " and ".join(f"{text.what} ({text.requirement})" for text in row)


def kind_of(row: Row) -> tuple[int, str]:
    """What texts in a row are one of."""
    return len(row), row[0].kind


@contextmanager
def ignoring(trial: Trial, channel: Channel | None = None) -> Iterator[Callable[[Row, str], None]]:
    """What judges the packet behind texts. They may close the connection instead; where all of them
    do, nothing can be said.
    """
    if isinstance(trial, ServerTrial) and channel == "ipc":
        trial.greeted("ipc").close()
    ignored: list[Row] = []

    def judge(row: Row, outcome: str) -> None:
        if outcome != "closes":
            trial.judge(outcome, f"the packet after {named(row)}")
            ignored.append(row)

    yield judge
    if not ignored:
        trial.not_observable("the testee closes the connection on all such texts: it ignores none")


@check(
    "JSN-9",
    observable="what the packet behind it brings about: memory is opened, a request answered, hello"
    " welcomed, or a version refused",
    on={
        CLIENT_IPC: OPENS_HOST_MEMORY,
        CLIENT_MSG: ("hello:msg", "returns:msg"),
        SERVER_IPC: ("1.1",),
        SERVER_MSG: (),
    },
    given=ignoring,
    cases={
        CLIENT_IPC: Cases(ROWS, kind=kind_of),
        CLIENT_MSG: Cases(ALONE, kind=lambda row: row[0].requirement),
        SERVER_IPC: Cases(ALONE, kind=kind_of, spare=SPARE),
        SERVER_MSG: Cases(ROWS, kind=kind_of),
    },
    may_crash=True,
)
def check_handles_the_next_packet(
    trial: Trial, channel: Channel, judge: Callable[[Row, str], None], row: Row
) -> None:
    """After each text that breaks a rule, and after three of them at once, comes a packet that has
    an effect; whoever closes the connection instead has ignored nothing.
    """
    texts = b"".join(packet(text.payload) for text in row)
    if isinstance(trial, ClientTrial) and channel == "msg":
        trial.role.welcomes = False
        if trial.number == 0 and _outcome_of_welcome(trial) == "ignores":
            trial.not_observable("the testee does not close on a version that it did not list")
        judge(row, _outcome_of_welcome(trial, texts))
    elif isinstance(trial, ServerTrial) and channel == "ipc":
        judge(row, _outcome_of_hello(trial, texts))
    elif isinstance(trial, ServerTrial):
        outcome = trial.outcome_on_msg(in_use(trial), texts)
        judge(row, "accepts" if outcome in ("ignores", "replies", "reports") else outcome)
    else:
        trial.role.offers_memory = False
        outcome = trial.outcome_on_ipc(trial.for_init_packet(), texts)
        judge(row, "accepts" if outcome == "ignores" else outcome)


def _outcome_of_hello(trial: ServerTrial, texts: bytes) -> str:
    connection = trial.before_hello("ipc")
    connection.send(texts)
    trial.viewer.greet(connection)
    handled = trial.is_welcomed(connection)
    closed = connection.ended and not trial.fate()
    connection.close()
    trial.delivered += 1
    return "closes" if closed else "accepts" if handled else trial.fate() or "ignores"


def _outcome_of_welcome(trial: ClientTrial, texts: bytes = b"") -> str:
    connection = trial.connection("msg")
    trial.says_hello(connection)
    connection.send(texts)
    if texts and trial.ends(connection, CLOSING_SECONDS):
        return "closes"
    trial.role.welcome(connection, version="9.9")
    if not trial.ends(connection) or trial.fate():
        return trial.fate() or "ignores"
    trial.delivered += 1
    trial.reassure("msg")
    return "accepts"
