"""Packets that a client is not sent whole (spec 1.0 section 2.1)."""

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import CLIENT, OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.v1_0.frm.pieces import APART_SECONDS
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.exchange import asked_on, exchange
from splatbus_conformance.trials.moves.losing import closing
from splatbus_conformance.trials.returning import PROBES
from splatbus_conformance.trials.trial import REACTION_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection


@check(
    "FRM-5",
    observable="the testee closes a connection on which a packet stays incomplete",
    on={CLIENT: ("ipc",)},
    profile="full",
)
def check_incomplete_packet_is_given_up(trial: ClientTrial) -> None:
    """A header and half a payload, then silence for longer than the limit; then the same with one
    byte more every second.
    """
    trial.role.welcomes = trial.role.offers_memory = False
    data = packet(encode(trial.role.legacy_init_packet()))
    limit = LIMITS["packet_completion_seconds"]
    for dribbles in (False, True):
        connection = trial.connection("ipc")
        if trial.ends(connection, SETTLE_SECONDS):
            trial.not_observable("the testee closes the ipc channel, whatever comes")
        connection.send(data[:100])
        for place in range(100, 100 + int(limit) if dribbles else 100):
            if not trial.ends(connection, 1.0):
                connection.send(data[place : place + 1])
        left = LIMITS["close_seconds"] + (0 if dribbles else limit)
        outcome = closing(trial, connection, left)
        what = f"a packet that stays incomplete for more than {limit} s"
        trial.judge(outcome, what + (", with a byte a second" if dribbles else ""))
        trial.delivered += 1


ENDS = tuple((kept, end) for kept in (1, 3, 4, 5, 200) for end in ("close", "reset"))
"""Bytes of a packet, and how the connection ends after them."""


def inside(case: tuple[int, str]) -> tuple[bool, str]:
    """Whether the header had come whole, and how the connection ended."""
    return case[0] > 4, case[1]


@check(
    "FRM-6",
    observable="after half an init packet and a new connection, the testee opens a whole one",
    on={CLIENT: (*OPENS_HOST_MEMORY, "reconnects:ipc")},
    may_crash=True,
)
def check_half_packet_is_discarded(trial: ClientTrial) -> None:
    """The connection ends inside an init packet, at the first byte, in the header and later; it is
    closed or reset. A testee that takes more connections to go on than after whole packets has
    given one up for what was left of the packet.
    """
    trial.role.offers_memory = False
    trial.greeted("ipc").close()
    usual, _ = trial.tries_to_go_on("ipc")
    for kept, end in trial.each(ENDS, kind=inside):
        connection = trial.greeted("ipc")
        connection.send(packet(encode(trial.role.init_packet(connection)))[:kept])
        trial.rest(APART_SECONDS)
        getattr(connection, end)()
        tries, came = trial.tries_to_go_on("ipc")
        outcome = "reconnects" if came else "hangs"
        what = f"a connection that ends after {kept} bytes of a packet, by {end}"
        trial.judge(outcome if tries <= usual else "closes", what)


@check(
    "FRM-6",
    observable="after half a reply and a new connection, the testee takes whole ones",
    on={CLIENT: ("asks", "reconnects:msg")},
    may_crash=True,
)
def check_half_reply_is_discarded(trial: ClientTrial) -> None:
    """The connection ends inside the reply that is awaited. Whoever continues it with what comes on
    the next connection finds a bad length there, and closes, or waits for what was announced.
    """
    for kept, end in trial.each(ENDS, kind=inside):
        half = exchange(trial, "msg", later=False)
        if not half or not half.awaited:
            trial.not_observable("nothing that the testee asks has a reply")
        reply = packet(encode(half.awaited[0]))
        half.connection.send(reply[: min(kept, len(reply) - 1)])
        trial.rest(APART_SECONDS)
        getattr(half.connection, end)()
        again = trial.next_connection("msg")
        for _ in range(PROBES):  # who ends it before anything was sent has read nothing there
            if again and trial.ends(again, REACTION_SECONDS) and not again.sent:
                again = trial.next_connection("msg")
        what = f"a connection that ends after {kept} bytes of a reply, by {end}"
        if again is None:
            trial.judge("hangs", what)
        else:
            trial.judge(_outcome_of_replies(trial, again), f"{what}: on the next connection")
            trial.delivered += bool(again.messages)


def _outcome_of_replies(trial: ClientTrial, connection: Connection) -> str:
    """Of whole replies to what is asked there: `ignores`, of whoever takes them as they are."""
    if trial.ends(connection, REACTION_SECONDS):
        return trial.fate() or "closes"
    whole = asked_on(trial, connection)
    for reply in whole.awaited:
        trial.role.say(connection, reply)
    if whole.awaited and whole.taken() is False:
        return trial.fate() or ("closes" if connection.ended else "hangs")
    return "ignores"
