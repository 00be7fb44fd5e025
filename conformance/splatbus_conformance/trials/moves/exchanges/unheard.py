"""Clients that say nothing on the IPC channel, those of 1.0: what their connections alone show."""

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import SETTLE_SECONDS
from splatbus_conformance.wire.sockets import Connection


def silent_connection(trial: ClientTrial) -> Connection:
    """A new IPC connection of a testee that says nothing on it; nothing is sent on it yet."""
    if trial.facts.speaks_1_1("ipc"):
        trial.not_observable("the testee speaks on the IPC channel, so another check judges it")
    trial.role.offers_memory = False
    newest = trial.peer.newest("ipc", lambda it: True)
    if newest and not newest.gone and not newest.sent:
        return newest
    return trial.connection("ipc")


def outcome_at_the_end(trial: ClientTrial, connection: Connection) -> str:
    """What the testee does when this connection ends: `lives`, `dies`, `exits` or `hangs`.

    One that is known to return has to. Of others it shows that they listen if they close a
    connection whose stream the harness ends; then they may exit, too.
    """
    if connection.ended:
        trial.wait(trial.fate, SETTLE_SECONDS)
    if fate := trial.fate():
        return fate
    if "ipc" in trial.facts.returns:
        connection.close()
        return "lives" if trial.comes_back("ipc") else trial.fate() or "hangs"
    connection.end_stream()
    noticed = trial.uses(lambda: connection.ended)  # some load CUDA for what came last
    trial.wait(trial.fate, SETTLE_SECONDS)
    if trial.fate() == "dies":
        return "dies"
    return "lives" if noticed or connection.ended else "hangs"
