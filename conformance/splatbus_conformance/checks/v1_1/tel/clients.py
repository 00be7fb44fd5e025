"""Checks on what a client does with telemetry (spec 1.1 annex A)."""

from hypothesis import strategies as st

from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.messages import SERIES
from splatbus_conformance.wire.sockets import Connection

WORDS = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=1, max_size=20)
VALUES = st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | WORDS
MEMBERS = st.dictionaries(st.sampled_from(("value", "unit", "edges", "counts")) | WORDS, VALUES)
KNOWN = {str(series["kind"]) for series in SERIES}
UNKNOWN = st.builds(
    lambda kind, members: {**members, "name": "later", "kind": kind},
    *(WORDS.filter(lambda word: word not in KNOWN), MEMBERS),
)


def subscribed(trial: ClientTrial) -> Connection:
    """A new connection on which the testee has subscribed to telemetry."""
    connection = trial.greeted("msg")
    dealings = trial.role.with_(connection)
    if not trial.wait(lambda: dealings.count("subscribe_telemetry") or connection.ended):
        trial.not_observable("the testee did not subscribe again")
    return connection


@check(
    "TEL-6",
    observable="the testee goes on; whether it kept the others of the message is not to be seen",
    on={CLIENT: ("hello:msg", "says:subscribe_telemetry", "returns:msg")},
    may_crash=True,
)
def check_ignores_series_of_unknown_kinds(trial: ClientTrial) -> None:
    """Telemetry in which series of kinds that nobody knows stand behind those of each kind."""
    connection = subscribed(trial)
    for series in trial.each([{"name": "later", "kind": "vector"}], UNKNOWN, quick=5, full=50):
        connection = subscribed(trial) if connection.ended else connection
        trial.role.tell(connection, series)
        outcome = trial.outcome_on_msg(connection)
        trial.judge(outcome, f"a series of the kind {series['kind']!r}")
