"""Conversations: a recording, put together again by connection and message."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from splatbus_conformance.lenient_json import Fault, read
from splatbus_conformance.packets import Packet, Splitter
from splatbus_conformance.recording import Channel, Direction, Entry

SENDER = {"c2s": "client", "s2c": "server"}


class Message(NamedTuple):
    """One packet in one direction, read."""

    direction: Direction
    packet: Packet
    value: dict[str, Any] | None
    """The JSON object, or None where the payload is none."""
    faults: tuple[Fault, ...]

    @property
    def sender(self) -> str:
        """`client` or `server`."""
        return SENDER[self.direction]

    @property
    def type(self) -> str | None:
        """The `type` of the message, where it has one that is a string."""
        kind = (self.value or {}).get("type")
        return kind if isinstance(kind, str) else None


@dataclass
class Conversation:
    """All that crossed one connection, messages in the order in which they were complete."""

    channel: Channel
    number: int
    opened: float
    messages: list[Message] = field(default_factory=list)
    streams: dict[Direction, Splitter] = field(
        default_factory=lambda: {"c2s": Splitter(), "s2c": Splitter()}
    )
    ended: dict[Direction, float] = field(default_factory=dict)
    """When each side ended its stream, by end of stream or reset."""

    def sent_by(self, peer: str) -> list[Message]:
        """The messages of `client` or `server`."""
        return [message for message in self.messages if message.sender == peer]

    @property
    def hello(self) -> Message | None:
        """The first readable `hello`, if there is one."""
        return next((m for m in self.sent_by("client") if m.type == "hello"), None)

    @property
    def welcome(self) -> Message | None:
        """The first readable `welcome`, if there is one."""
        return next((m for m in self.sent_by("server") if m.type == "welcome"), None)


def conversations(entries: Iterable[Entry]) -> list[Conversation]:
    """Put a recording together, connections in the order in which they were opened."""
    found: dict[tuple[str, int], Conversation] = {}
    for entry in entries:
        key = (entry.channel, entry.conn)
        if key not in found:
            found[key] = Conversation(entry.channel, entry.conn, entry.t)
        conversation = found[key]
        if entry.data is not None and entry.dir is not None:
            for packet in conversation.streams[entry.dir].feed(entry.data, entry.t):
                value, faults = read(packet.payload)
                conversation.messages.append(Message(entry.dir, packet, value, faults))
        elif entry.event in ("eof", "reset") and entry.dir is not None:
            conversation.ended[entry.dir] = entry.t
    return list(found.values())
