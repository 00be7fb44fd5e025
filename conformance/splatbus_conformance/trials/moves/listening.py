"""What a client says by itself; each is given its time for that."""

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.sockets import Connection

LISTENING_SECONDS = 0.4


def heard(trial: ClientTrial, connection: Connection) -> set[str]:
    """The types of all that the testee said on a connection."""
    return {str(message.get("type")) for message in trial.with_(connection).heard}


def listen(trial: ClientTrial, *connections: Connection) -> None:
    """Give what need not come several times as long as this testee took to say its first word."""
    first = [it.arrived(it.messages[0]) - it.opened for it in connections if it.messages]
    trial.rest(max(LISTENING_SECONDS, *(4 * seconds for seconds in first), 0.0))
