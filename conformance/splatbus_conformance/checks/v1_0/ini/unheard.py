"""Checks on clients that say nothing on the IPC channel: those of 1.0, by their connections alone.

What they did with a packet is not to be seen there, but that they close, live and come back is.
"""

import itertools
from collections.abc import Sequence

from splatbus_conformance.cases.malformed.init_packets import breaches_of_1_0, changed
from splatbus_conformance.cases.malformed.text import BrokenText, broken_texts
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.checks.v1_0.ini.clients import OTHERS, TYPES
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.unheard import (
    outcome_at_the_end,
    silent_connection,
)
from splatbus_conformance.trials.trial import REACTION_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.messages import encode, init_packet_1_0
from splatbus_conformance.wire.packets import packet

HANDLES = ("", "A" * 88, "A" * 87, "-" * 86 + "==", "=" * 88, 5, None, ["A" * 88])
ON_A_CONNECTION = 8
PAUSE_SECONDS = 0.003
"""Between payloads of a row, so that a close is seen before the next is sent."""


@check(
    "INI-11",
    observable="the connection stays open, and the testee still notices its end",
    on={CLIENT: ("ipc",)},
    may_crash=True,
)
def check_ignores_what_is_no_init_packet_unheard(trial: ClientTrial) -> None:
    """JSON objects of other shapes before an init packet, each on a connection on which nothing
    else comes, and all of them on one. That the testee notices the end of the connection shows
    that it has read what came before.
    """
    good = init_packet_1_0(trial.role.width, trial.role.height)
    typed = [good | {"type": kind} for kind in TYPES]
    rows = [[other] for other in (*typed, *OTHERS)]
    for row in trial.each([[*typed, *OTHERS], *rows], kind=len):
        connection = silent_connection(trial)
        connection.send(b"".join(packet(encode(other)) for other in row))
        shown = encode(row[0])[:60].decode("ascii", "replace")
        what = f"{len(row)} objects that are no init packets, the first {shown}"
        if trial.ends(connection, REACTION_SECONDS):
            trial.judge(trial.fate() or "closes", what)
        outcome = outcome_at_the_end(trial, connection)
        trial.judge("ignores" if outcome == "lives" else outcome, what)


@check(
    "JSN-10",
    observable="the process lives, and the testee connects again when the harness closes",
    on={CLIENT: ("ipc",)},
    may_crash=True,
)
def check_survives_broken_payloads_unheard(trial: ClientTrial) -> None:
    """Broken texts and broken 1.0 init packets, a few to a connection, and a good packet after
    them, for a testee that says nothing on the IPC channel. That it connects again, or notices the
    end of the connection, shows that what listens there is alive.
    """
    payloads = trial.each(_broken(trial), kind=lambda it: it.kind)
    while row := list(itertools.islice(payloads, ON_A_CONNECTION)):
        outcome = _outcome_of(trial, row)
        if outcome not in trial.requirement.acceptable:
            for broken in row:
                alone = _outcome_of(trial, [broken])
                trial.judge(alone, f"{broken.what} ({broken.requirement}) on the ipc channel")
        words = " and ".join(f"{broken.what} ({broken.requirement})" for broken in row)
        trial.judge(outcome, f"on the ipc channel {words}")


def _outcome_of(trial: ClientTrial, row: Sequence[BrokenText]) -> str:
    connection = silent_connection(trial)
    for broken in row:
        if connection.ended:
            outcome = outcome_at_the_end(trial, connection)
            if outcome != "lives":
                return outcome
            connection = silent_connection(trial)
        connection.send(packet(broken.payload))
        trial.ends(connection, PAUSE_SECONDS)
    connection.send(packet(encode(trial.role.legacy_init_packet())))
    closed = trial.ends(connection, SETTLE_SECONDS)
    outcome = outcome_at_the_end(trial, connection)
    return ("closes" if closed else "ignores") if outcome == "lives" else outcome


def _broken(trial: ClientTrial) -> list[BrokenText]:
    good = init_packet_1_0(trial.role.width, trial.role.height)
    texts = broken_texts(good)
    for member in ("mem_color", "mem_depth", "evt_done"):
        for handle in HANDLES:
            payload = encode(good | {member: handle})
            texts.append(BrokenText("INI-7", f"{member} {handle!r}", payload, "INI-7"))
    for breach in breaches_of_1_0():
        sized = init_packet_1_0(breach.width, breach.height)
        kind = " ".join(map(str, breach.kind))
        payload = encode(changed(sized, breach.changes))
        texts.append(BrokenText(breach.requirement, breach.what, payload, kind))
    return texts
