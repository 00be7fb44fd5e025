"""What a connection makes of bytes, and what it has to say."""

from splatbus_server.connection import Connection, Event, Terms
from splatbus_wire.messages import Channel, Program

from tests.peers.raw_client import hello, packet, packets

OPEN = Terms(Program("s", "1"), {"ipc": ("host_shm", "frames"), "msg": ()})
GUARDED = OPEN._replace(token="secret")
REQUEST = packet({"type": "get_viewport_size"})


def events(connection: Connection, data: bytes, now: float = 0.0) -> list[Event]:
    connection.receive(data, now)
    found = []
    while (event := connection.next_event(now)) is not None:
        found.append(event)
    return found


def sent(connection: Connection) -> list[dict[str, object]]:
    """Takes what waits to be sent, as messages."""
    data = bytes(connection.unsent)
    connection.sent(len(data), 0.0)
    return packets(data)


def greeted(channel: Channel = "msg", *capabilities: str) -> Connection:
    connection = Connection(channel, OPEN, 0.0)
    events(connection, packet(hello(*capabilities)))
    sent(connection)
    return connection
