"""Clients that ask: a connection on which a request waits for its reply."""

import time

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.message_kinds import REQUESTS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection


def requests(trial: ClientTrial, connection: Connection) -> list[Json]:
    """The requests that the testee has made on this connection, in order."""
    heard = trial.with_(connection).heard
    return [message for message in heard if message.get("type") in REQUESTS]


def asking(trial: ClientTrial) -> Connection:
    """A message connection on which a request waits for its reply.

    Some ask only once after they were started: such a testee is started anew. Skips the check
    where that is not possible, and nothing is asked.
    """
    trial.role.replies, since = False, time.monotonic()
    connection = _connection(trial, since)
    if connection is None:
        trial.facts.asks_again = False
        connection = _connection(trial, since)
    trial.role.replies = True
    if connection is None:
        trial.not_observable("the testee makes no request when it connects again")
    return connection


def _connection(trial: ClientTrial, since: float) -> Connection | None:
    if not trial.facts.asks_again:
        trial.end_testee()
    connection = trial.connection("msg")
    if connection.opened < since and requests(trial, connection):  # which had their replies
        connection = trial.connection("msg")
    trial.wait(lambda: requests(trial, connection) or connection.ended)
    return connection if requests(trial, connection) else None
