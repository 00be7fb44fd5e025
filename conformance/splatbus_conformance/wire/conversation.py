"""Conversations: a recording, put together again by connection and message."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import itemgetter
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.json_reading import PayloadFault, read, take_numbers, too_many
from splatbus_conformance.wire.message_kinds import kind_of, shape_of
from splatbus_conformance.wire.packets import Packet, Splitter
from splatbus_conformance.wire.recording import Channel, Direction, Entry

SENDER = {"c2s": "client", "s2c": "server"}
MOST_VALUES = {"c2s": LIMITS["max_client_values"], "s2c": LIMITS["max_server_values"]}


class Message(NamedTuple):
    """One packet in one direction, read."""

    direction: Direction
    packet: Packet
    value: dict[str, Any] | None
    """The JSON object, with numbers for the strings that spell them; None where it is no object."""
    faults: tuple[PayloadFault, ...]
    kind: str | None = None
    """What it is meant to be (`kinds.kind_of`), which its `type` may miss."""

    @property
    def sender(self) -> str:
        """`client` or `server`."""
        return SENDER[self.direction]

    @property
    def type(self) -> str | None:
        """The `type` of the message, where it has one that is a string."""
        kind = (self.value or {}).get("type")
        return kind if isinstance(kind, str) else None

    @property
    def agrees(self) -> bool:
        """It is a `welcome`, and not one to 1.0, with which nothing is agreed (NEG-33)."""
        return self.kind == "welcome" and (self.value or {}).get("version") != "1.0"


@dataclass(eq=False)
class Conversation:
    """All that crossed one connection, messages in the order in which they were complete.

    What is asked of it is found once and kept: whoever judges one that grows has to take a copy.
    """

    channel: Channel
    number: int
    opened: float
    messages: list[Message] = field(default_factory=list)
    streams: dict[Direction, Splitter] = field(
        default_factory=lambda: {"c2s": Splitter(), "s2c": Splitter()}
    )
    ended: dict[Direction, float] = field(default_factory=dict)
    """When each side ended its stream, by end of stream or reset."""
    resets: set[Direction] = field(default_factory=set)
    """The sides that ended it by a reset."""
    died: set[Direction] = field(default_factory=set)
    """The sides whose process ended with it, as far as that is known."""
    beside: list["Conversation"] = field(default_factory=list, repr=False)
    """Every conversation of the recording, this one among them."""

    @property
    def recording(self) -> "Conversation":
        """The first conversation of the recording, which stands for the whole of it."""
        return self.beside[0] if self.beside else self

    def sent_by(self, peer: str) -> list[Message]:
        """The messages of `client` or `server`."""
        return self._by_sender[peer]

    def of(self, *kinds: str) -> list[Message]:
        """The messages of these kinds."""
        return [message for message, *_ in self.placed(*kinds)]

    def placed(self, *kinds: str) -> Sequence["MessageInContext"]:
        """The messages of these kinds, or all, each with how far the negotiation had come."""
        if not kinds:
            return self._placed
        found = [each for kind in kinds for each in self._by_kind.get(kind, ())]
        return [each for _, each in sorted(found, key=itemgetter(0))]

    @cached_property
    def hello(self) -> Message | None:
        """The first readable `hello`, if there is one."""
        return next((m for m in self.sent_by("client") if m.kind == "hello"), None)

    @cached_property
    def welcome(self) -> Message | None:
        """The first readable `welcome` to 1.1, if there is one."""
        return next((m for m in self.sent_by("server") if m.agrees), None)

    @cached_property
    def _by_sender(self) -> dict[str, list[Message]]:
        found: dict[str, list[Message]] = {sender: [] for sender in SENDER.values()}
        for message in self.messages:
            found[message.sender].append(message)
        return found

    @cached_property
    def _by_kind(self) -> dict[str | None, list[tuple[int, "MessageInContext"]]]:
        """With the place of each among all."""
        found: dict[str | None, list[tuple[int, MessageInContext]]] = {}
        for each in enumerate(self._placed):
            found.setdefault(each[1].message.kind, []).append(each)
        return found

    @cached_property
    def _placed(self) -> list["MessageInContext"]:
        hello = welcome = None
        found = []
        for message in self.messages:
            found.append(MessageInContext(message, hello, welcome))
            if message.kind == "hello":
                hello = hello or message
            elif message.agrees:
                welcome = welcome or message
        return found


class MessageInContext(NamedTuple):
    """A message, and the first `hello` and `welcome` that came before it."""

    message: Message
    hello: Message | None
    welcome: Message | None


class Assembler:
    """A recording put together as it grows.

    Attributes:
        conversations: in the order in which they were opened.
    """

    def __init__(self) -> None:
        self.conversations: list[Conversation] = []
        self._by_key: dict[tuple[str, int], Conversation] = {}
        self._welcomed: set[tuple[str, int]] = set()

    def feed(self, entry: Entry) -> tuple[Conversation, list[Message]]:
        """Take what crossed next; the conversation that it is of, and what it completes there."""
        key = (entry.channel, entry.conn)
        conversation = self._by_key.get(key)
        if conversation is None:
            conversation = Conversation(
                entry.channel, entry.conn, entry.t, beside=self.conversations
            )
            self._by_key[key] = conversation
            self.conversations.append(conversation)
        completed = []
        if entry.data is not None and entry.dir is not None:
            for packet in conversation.streams[entry.dir].feed(entry.data, entry.t):
                message = _message(entry, packet, negotiated=key in self._welcomed)
                completed.append(message)
                if message.agrees:
                    self._welcomed.add(key)
            conversation.messages += completed
        elif entry.event in ("eof", "reset") and entry.dir is not None:
            conversation.ended.setdefault(entry.dir, entry.t)
            if entry.event == "reset":
                conversation.resets.add(entry.dir)
        return conversation, completed

    def so_far(self) -> list[Conversation]:
        """The conversations as they are now, to be judged as if they ended here."""
        # Copies without what a conversation keeps of an earlier look: a `welcome` may have come.
        # They are judged while more is fed.
        beside: list[Conversation] = []
        beside += (
            replace(
                each,
                messages=list(each.messages),
                ended=dict(each.ended),
                resets=set(each.resets),
                beside=beside,
            )
            for each in self.conversations
        )
        return beside


def conversations(entries: Iterable[Entry]) -> list[Conversation]:
    """Put a recording together, connections in the order in which they were opened."""
    assembler = Assembler()
    for entry in entries:
        assembler.feed(entry)
    return assembler.conversations


def _message(entry: Entry, packet: Packet, *, negotiated: bool) -> Message:
    assert entry.dir is not None
    value, faults = read(packet.payload)
    if value is None:
        return Message(entry.dir, packet, None, faults)
    values = too_many(packet.payload, value, MOST_VALUES[entry.dir])
    kind = kind_of(entry.channel, entry.dir, value)
    value, strings = take_numbers(value, shape_of(kind, negotiated=negotiated))
    return Message(entry.dir, packet, value, (*faults, *values, *strings), kind)
