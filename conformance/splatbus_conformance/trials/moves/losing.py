"""How a client's connections are lost, and when it has lost one."""

import time

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.message_kinds import CLOSING_ERRORS, OTHER_ERRORS
from splatbus_conformance.wire.messages import error
from splatbus_conformance.wire.sockets import Connection

ENDS = ("close", "reset", "end")
"""How a connection is lost; `end` is a half-close."""
BAD_LENGTH = "a length that no packet may have"
TOMORROW = "a_code_of_tomorrow"
CODES = (*CLOSING_ERRORS, *OTHER_ERRORS, TOMORROW)


def lose(trial: ClientTrial, connection: Connection, how: str) -> float:
    """End a connection in one of the ENDS, by a BAD_LENGTH, or by an `error` of this code; when it
    began.

    After an error whose code does not close the testee may go on.
    """
    trial.rest(0.0)
    began = time.monotonic()
    if how == "close":
        connection.close()
    elif how == "reset":
        connection.reset()
    elif how == BAD_LENGTH:
        connection.send(bytes(4))
        trial.ends(connection)
        connection.close()
    elif how in OTHER_ERRORS or how == TOMORROW:
        trial.role.say(connection, error(how))
        trial.ends(connection, REACTION_SECONDS)
    else:
        if how != "end":
            trial.role.say(connection, error(how))
        connection.end_stream()
        trial.ends(connection)
        connection.close()
    return began


def kind_of_code(code: str) -> str:
    """Whether an `error` of this code closes; that of tomorrow is of a kind of its own."""
    return code if code == TOMORROW else "closes" if code in CLOSING_ERRORS else "stays"


def closing(trial: ClientTrial, connection: Connection, seconds: float) -> str:
    """`closes` if the testee ends this connection in time, also by an orderly exit; `dies` if it
    ends the connection only because it crashed.
    """
    closed = trial.ends(connection, seconds)
    trial.wait(trial.fate, REACTION_SECONDS)
    if trial.fate() == "dies":
        return "dies"
    return "closes" if closed else "hangs"
