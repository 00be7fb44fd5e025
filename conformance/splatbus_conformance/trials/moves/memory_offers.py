"""Memory of the host that is offered to a client in init packets of a check's own."""

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.messages import Json, encode, init_packet_1_1
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

NOWHERE = init_packet_1_1("splatbus-check-never-was", 0)
"""Names memory that does not exist."""


def announce(trial: ClientTrial, connection: Connection, init_packet: Json) -> int:
    """Send an init packet with the next generation of a connection, which is returned."""
    generation = trial.role.next_generation(connection)
    trial.role.offer(connection, init_packet | {"generation": generation})
    return generation


def outcome_of(trial: ClientTrial, init_packet: Json, connection: Connection | None = None) -> str:
    """What becomes of one that is announced so, as `outcome_on_ipc` tells."""
    connection = connection or trial.for_init_packet()
    generation = trial.role.next_generation(connection)
    offered = packet(encode(init_packet | {"generation": generation}))
    return trial.outcome_on_ipc(connection, offered)
