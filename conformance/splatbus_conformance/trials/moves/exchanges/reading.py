"""Whether a client reads the replies that it is sent."""

from collections import Counter

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.asking import asking, requests
from splatbus_conformance.trials.trial import EFFECT_SECONDS, ENDING_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.sockets import Connection

MOST_WAITS = 3
"""How often whoever asks on is given the time of an effect for the rest."""
SIZE = "get_viewport_size"
TIMES_AGAIN = 4
"""Whoever asks for the size so often has read what it asked for in between."""


def answer_all(trial: ClientTrial, connection: Connection) -> None:
    """Reply to what the testee has asked on this connection, as a good server does."""
    for request in requests(trial, connection):
        trial.role.reply(connection, request)


def asked(trial: ClientTrial, connection: Connection) -> Counter[str]:
    """How often what was asked for on this connection."""
    return Counter(message["type"] for message in requests(trial, connection))


def wait_for_all(trial: ClientTrial, connection: Connection, wanted: Counter[str]) -> bool:
    """Whether it asks for so much; it has time as long as it asks on at all."""
    for _ in range(MOST_WAITS):
        before = asked(trial, connection)
        if trial.wait(lambda: asked(trial, connection) >= wanted or connection.ended):
            break
        if asked(trial, connection) == before:
            break
    return asked(trial, connection) >= wanted


def asked_after_plain_replies(trial: ClientTrial) -> Counter[str]:
    """What whole, plain replies, from now on with the size [0,0], make the testee ask for: each
    once, and `SIZE` as `TIMES_AGAIN` says where it asks on.
    """
    nothing = {"viewport_size": [0, 0]}  # the lens of cameras is that of images that there are
    trial.role.spoil = lambda reply: reply | nothing if "viewport_size" in reply else reply
    connection = asking(trial)
    answer_all(trial, connection)
    most = Counter(trial.facts.asks) + Counter({SIZE: TIMES_AGAIN - 1})
    seconds = EFFECT_SECONDS if SIZE in trial.facts.asks else REACTION_SECONDS
    trial.wait(lambda: asked(trial, connection) >= most or connection.ended, seconds)
    made = asked(trial, connection) & most
    return made if made[SIZE] == TIMES_AGAIN else Counter(made.keys())


def outcome_of_reading(trial: ClientTrial, connection: Connection) -> str:
    """What the testee does after it was sent something on the message channel.

    As `outcome_on_msg`; one that is not known to come back shows by going on, or by noticing that
    the harness closes, that it has read it. One that never notices that shows nothing: it ignores,
    and nothing was delivered.
    """
    if "msg" in trial.facts.returns:
        return trial.outcome_on_msg(connection)
    if trial.fate() is None and not connection.ended:
        connection.end_stream()
        noticed = trial.ends(connection)
        trial.wait(trial.fate, REACTION_SECONDS)
        leaves = trial.facts.leaves and trial.fate() == "exits"
        if noticed and (leaves or trial.fate() is None):
            trial.controls += 1
            return "ignores"
        if trial.fate() is None and not _notices_the_end_after_replies(trial):
            return "ignores"
    if connection.ended and not trial.wait(trial.fate, ENDING_SECONDS):
        trial.controls += 1  # it has closed, and lives
    return trial.fate() or ("closes" if connection.ended else "hangs")


def _notices_the_end_after_replies(trial: ClientTrial) -> bool:
    """Whether it closes a connection whose stream ends after whole, plain replies (CHN-17)."""
    if trial.facts.notices_the_end is None:
        role = trial.role
        spoil, role.spoil = role.spoil, lambda reply: reply
        spelling, role.encode["msg"] = role.encode["msg"], encode
        connection = asking(trial)
        answer_all(trial, connection)
        trial.wait(lambda: all(map(role.with_(connection).count, trial.facts.asks)))
        trial.rest(REACTION_SECONDS)
        connection.end_stream()
        trial.facts.notices_the_end = trial.ends(connection)
        role.spoil, role.encode["msg"] = spoil, spelling
    return trial.facts.notices_the_end
