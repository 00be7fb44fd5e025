"""Whether a client that comes back means it: some look first, and close what they looked with."""

from typing import TYPE_CHECKING

from splatbus_conformance.peer import Connection

if TYPE_CHECKING:
    from splatbus_conformance.client_trial import ClientTrial


def goes_on_with(trial: "ClientTrial", connection: Connection) -> bool:
    """Whether the testee says on this connection what it says on one that it keeps.

    A client that speaks 1.0 has nothing to say on the IPC channel.
    """
    if connection.channel == "msg":
        trial.wait(lambda: connection.packets or connection.ended)
        return bool(connection.packets)
    if not trial.facts.speaks_1_1("ipc"):
        return True
    role = trial.role
    dealings = role.with_(connection)

    def greeted() -> bool:
        return bool(dealings.welcome or (dealings.hello and not role.welcomes))

    trial.wait(lambda: greeted() or connection.ended)
    if not (greeted() and dealings.welcome and trial.facts.opens):
        return greeted()
    if not role.offers_memory:
        role.offer(connection, role.init_packet(connection))
    return trial.opens(connection)
