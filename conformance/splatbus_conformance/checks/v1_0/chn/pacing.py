"""Checks on when a client connects again (spec 1.0 section 3.3, spec 1.1 section 2.5)."""

import random
import time
from collections import Counter
from collections.abc import Sequence

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.init_packets import changed
from splatbus_conformance.checks import CLIENT, CLIENT_IPC, CLIENT_MSG, Cases, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.losing import BAD_LENGTH, CODES, ENDS, kind_of_code, lose
from splatbus_conformance.trials.returning import PROBES
from splatbus_conformance.trials.trial import REACTION_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.message_kinds import CLOSING_ERRORS
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

LEAST: float = LIMITS["reconnect_min_seconds"]
MOST: float = LIMITS["reconnect_max_seconds"]
ERROR_PAUSE: float = LIMITS["error_pause_seconds"]
SLOW_SECONDS = 10 * LEAST
"""Whoever was away for so long needs no second look: each costs as long."""
LOST = (*ENDS, BAD_LENGTH, *CLOSING_ERRORS)
NOWHERE = "splatbus-check-never-was"
IN_A_ROW = 6
"""Connections one after the other: of each, what the testee does until it closes takes time."""
TIMES = 9
"""That a hot loop is there at once when a channel accepts again."""
LATE_TIMES = 3
"""That whoever pauses is there later; a hot loop that a busy machine delays may be so twice."""
AT_ONCE_SECONDS = LEAST / 5
"""Whoever leaves LEAST between attempts is there so soon one time of five."""
LONG_SECONDS = 4.0
"""For which a channel refuses, so that attempts in a row fail; more fail the sooner they come."""
LONGEST_SECONDS = 9.0
LATE_SECONDS = 1.0
"""By how much more than MOST a testee comes late, whose attempts the harness cannot see."""


def after(trial: ClientTrial, channel: Channel, lost: float) -> Connection:
    """The next connection of this testee that it made after one was lost."""
    connection = _later(trial, channel, lost)
    if connection is None:
        trial.not_observable(f"the testee did not come back to the {channel} channel")
    return connection


def _later(trial: ClientTrial, channel: Channel, lost: float) -> Connection | None:
    connection = trial.next_connection(channel)
    while connection is not None and connection.opened < lost:
        connection = trial.next_connection(channel)
    return connection


def expect_apart(
    trial: ClientTrial, seconds: float, what: str, attempts: int = 2, least: float = LEAST
) -> None:
    """So many attempts began in at most this time, with pauses of so many seconds between two."""
    trial.expect(
        seconds >= (attempts - 1) * least,
        "too-soon",
        f"{what}, {attempts} attempts began within {1000 * seconds:.0f} ms;"
        f" {1000 * least:.0f} are asked for between two",
    )


def coming_back(trial: ClientTrial) -> list[Channel]:
    """The channels whose attempts can be seen."""
    if not trial.facts.returns:
        trial.not_observable("the testee does not connect again")
    return sorted(trial.facts.returns)


@check(
    "CHN-21",
    on={CLIENT: ()},
    given=coming_back,
    cases=lambda trial, back: Cases(
        LOST if any(map(trial.facts.speaks_1_1, back)) else LOST[:4],
        kind=lambda how: "error" if how in CLOSING_ERRORS else how,  # its code does not matter
        spare=0,
    ),
)
def check_paces_its_attempts(trial: ClientTrial, back: list[Channel], how: str) -> bool:
    """Connections are closed, reset, half-closed, and sent a length on which the testee closes
    them, each way twice, on each channel; in 1.1, an `error` comes in place of `welcome`, twice.

    The first of two attempts begins after a connection was lost, and the second before it is
    accepted, however late the harness looks.
    """
    errs = how in CLOSING_ERRORS
    channels = [it for it in back if trial.facts.speaks_1_1(it) or not errs]
    met = [trial.connection(channel) for channel in channels]
    trial.rest(SETTLE_SECONDS)
    trial.role.welcomes = not errs
    lost = [lose(trial, connection, how) for connection in met]
    seen = False
    again = []
    for connection, begun in zip(met, lost, strict=True):
        if not connection.gone:
            connection.close()
            continue
        back_again = after(trial, connection.channel, begun)
        if back_again.opened - begun < SLOW_SECONDS:
            again.append((back_again, begun))
        else:
            seen = True
    for connection, _ in again:
        if errs and not trial.says_hello(connection):
            trial.not_observable("the testee said no hello when it came back")
    second = [lose(trial, connection, how) for connection, _ in again]
    trial.role.welcomes = True
    for (connection, begun), once_more in zip(again, second, strict=True):
        if not connection.gone:
            connection.close()
            continue
        apart = after(trial, connection.channel, once_more).opened - begun
        what = f"after {'an error ' * errs}{how}, on the {connection.channel} channel"
        expect_apart(trial, apart, what)
        seen = True
    for channel in channels:
        trial.reassure(channel)
    return seen


@check("CHN-21", on={CLIENT: ("reconnects:ipc",)})
def check_paces_attempts_without_images(trial: ClientTrial) -> None:
    """Every connection is sent an init packet of memory that cannot be opened. A testee that closes
    it, and comes back for more, must still pause, however many come in a row.
    """
    trial.role.offers_memory = False
    trial.role.speaks = "1.1" if trial.facts.opens else "1.0"
    connection: Connection | None = trial.connection("ipc")
    sent: list[float] = []
    while connection is not None and len(sent) < IN_A_ROW:
        for attempts, first in enumerate(reversed(sent[:-1]), 2):
            within = connection.opened - first  # they began after what was sent first
            expect_apart(trial, within, "given memory that it cannot open", attempts)
        sent.append(time.monotonic())
        closes = _closes_on_what_it_cannot_open(trial, connection)
        connection = _later(trial, "ipc", sent[-1]) if closes else None
    if trial.fate():
        trial.end_testee()  # that it goes on is another sentence, with checks of its own
    if len(sent) < 3:
        trial.not_observable("the testee does not come back for memory that it cannot open")


def _closes_on_what_it_cannot_open(trial: ClientTrial, connection: Connection) -> bool:
    before, dealings = len(trial.calls()), trial.with_(connection)
    packet = trial.role.legacy_init_packet()
    if trial.role.speaks == "1.1":
        trial.says_hello(connection)
        packet = changed(trial.role.init_packet(connection), {"memory/name": NOWHERE})
    trial.role.offer(connection, packet)

    def has_tried() -> bool:
        return bool(dealings.failed) or any(not call.ok for call in trial.calls()[before:])

    trial.wait(lambda: has_tried() or connection.ended)
    return trial.ends(connection, REACTION_SECONDS)


@check("CHN-21", on={CLIENT: ()})
def check_paces_attempts_that_are_refused(trial: ClientTrial) -> None:
    """The channels refuse for a while, of another length each time, then accept; a testee that is
    there at once each time tries all the time. A busy machine may make it late now and then.
    """
    lengths = random.Random(trial.seed)
    channels = coming_back(trial)
    lost = {channel: lose(trial, trial.connection(channel), "close") for channel in channels}
    usual = max(after(trial, channel, lost[channel]).opened - lost[channel] for channel in channels)
    at_once, later = Counter[Channel](), Counter[Channel]()
    while open_to_doubt := [it for it in channels if later[it] < LATE_TIMES]:
        for channel in open_to_doubt:
            trial.peer.refuse(channel)
            trial.next_connection(channel, 0.0)  # closes the one before
        trial.rest(usual + lengths.uniform(0.2, 0.4))
        listening = time.monotonic()
        for channel in open_to_doubt:
            trial.peer.listen(channel)
        for channel in open_to_doubt:
            soon = after(trial, channel, listening).opened - listening <= AT_ONCE_SECONDS
            (at_once if soon else later)[channel] += 1
            trial.expect(
                at_once[channel] < TIMES,
                "too-soon",
                f"{TIMES} times that the {channel} channel accepted again, an attempt came within "
                f"{1000 * AT_ONCE_SECONDS:.0f} ms: it does not pause when it is refused",
            )


@check("CHN-21", on={CLIENT: ()}, profile="quick")
def check_paces_attempts_that_are_refused_for_long(trial: ClientTrial) -> None:
    """Both channels refuse for some seconds, so that a pause which grows has grown, or come to the
    end of its table; one then accepts, a moment later the other, and the first connection of each
    is closed as soon as it is made, without a word that could begin the table anew.
    """
    channels = coming_back(trial)
    refuse(trial, channels)
    trial.role.welcomes = trial.role.offers_memory = trial.role.replies = False
    trial.rest(LONG_SECONDS)
    listening: dict[Channel, float] = {}
    for channel in channels:
        listening[channel] = time.monotonic()
        trial.peer.listen(channel)
        trial.rest(AT_ONCE_SECONDS)

    def came(channel: Channel) -> list[Connection]:
        on_it = (c for c in trial.peer.connections if c.channel == channel)
        return [c for c in on_it if c.opened >= listening[channel]]

    def each_came_twice() -> bool:
        for first in [c for channel in channels for c in came(channel)[:1]]:
            first.close()
        return all(len(came(channel)) > 1 for channel in channels)

    trial.wait(each_came_twice, 2 * trial.return_seconds())
    for channel in channels:
        apart = after(trial, channel, listening[channel]).opened - listening[channel]
        what = f"after {LONG_SECONDS:g} s in which the {channel} channel refused"
        expect_apart(trial, apart, what)


def refuse(trial: ClientTrial, channels: Sequence[Channel]) -> None:
    """Refuse on these channels from now on, and lose the connections that there are."""
    for channel in channels:
        trial.connection(channel)
    for channel in channels:
        trial.peer.refuse(channel)
    trial.peer.clear()


@check(
    "NEG-24",
    on={
        CLIENT_IPC: ("hello:ipc", "reconnects:ipc"),
        CLIENT_MSG: ("hello:msg", "reconnects:msg"),
    },
    cases=Cases(CODES, kind=kind_of_code, spare=1),
)
def check_pauses_after_errors(trial: ClientTrial, channel: Channel, code: str) -> bool:
    """An `error` in place of `welcome`, twice in a row, with codes that close and others.

    The error is received after it was sent, and an attempt begins before it is accepted.
    """
    trial.role.welcomes, paused = False, False
    connection = trial.connection(channel)
    for _ in range(2):
        if not trial.says_hello(connection):
            trial.not_observable("the testee said no hello")
        told = lose(trial, connection, code)
        if not connection.gone:
            connection.close()
            break
        connection = after(trial, channel, told)
        pause, paused = connection.opened - told, True
        what = f"since an error {code} was sent on the {channel} channel"
        expect_apart(trial, pause, what, least=ERROR_PAUSE)
        if pause >= SLOW_SECONDS:
            break
    trial.role.welcomes = True
    trial.reassure(channel)
    return paused


@check("CHN-22", on={CLIENT: ()})
def check_comes_back_soon(trial: ClientTrial) -> None:
    """Connections are refused until a pause that doubles each time would be too long (for a second
    in the brief profile), then accepted; and lost, in 1.1 by an `error`.
    """
    channels = coming_back(trial)
    lost = lose(trial, trial.connection(channels[0]), "close")
    usual = after(trial, channels[0], lost).opened - lost
    refuse(trial, channels)
    trial.rest(1.0 if trial.profile == "brief" else until_too_long(usual))
    for channel in channels:
        trial.peer.listen(channel)
    for channel in channels:
        _expect_soon(trial, channel, 0, "it accepts again")
    for channel in channels:
        how = CLOSING_ERRORS[trial.seed % len(CLOSING_ERRORS)]
        how = how if trial.facts.speaks_1_1(channel) else ENDS[trial.seed % len(ENDS)]
        trial.connection(channel)
        trial.reassure(channel)
        connection = _kept(trial, channel)
        before = sum(c.channel == channel for c in trial.peer.connections)
        lose(trial, connection, how)
        _expect_soon(trial, channel, before, f"it was lost ({how})")


def until_too_long(first: float) -> float:
    """When, of pauses of which each is twice the one before, one has just begun that is too long.

    Args:
        first: of the pauses, in seconds.
    """
    pause, began = max(first, LEAST), 0.0
    while pause < MOST + 1.2 * LATE_SECONDS:
        began, pause = began + pause, 2 * pause
    return min(began + LEAST, LONGEST_SECONDS)


def _kept(trial: ClientTrial, channel: Channel) -> Connection:
    """A connection that is no mere look at whether the server is there."""
    for _ in range(PROBES):
        connection = trial.connection(channel)
        if _stays(trial, connection):
            return connection
    return trial.connection(channel)


def _stays(trial: ClientTrial, connection: Connection) -> bool:
    if trial.facts.speaks_1_1(connection.channel):
        trial.wait(lambda: trial.with_(connection).hello or connection.ended)
    else:
        trial.rest(SETTLE_SECONDS)
    return not connection.ended


def _expect_soon(trial: ClientTrial, channel: Channel, before: int, when: str) -> None:
    came = trial.arrives(channel, MOST + LATE_SECONDS, before)
    trial.expect(
        came, "too-late", f"no attempt on the {channel} channel within {MOST} s after {when}"
    )
