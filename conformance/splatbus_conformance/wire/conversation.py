"""Conversations: a recording, put together again by connection and message."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.json_reading import PayloadFault, read, take_numbers, too_many
from splatbus_conformance.wire.message_kinds import kind_of, shape_of
from splatbus_conformance.wire.packets import Packet, Splitter
from splatbus_conformance.wire.recording import Channel, Direction, Entry
from splatbus_conformance.wire.shelf import Picked, Row, Shelf

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
    def members(self) -> dict[str, Any]:
        """Those of the object; none where it is none."""
        return self.value or {}

    @property
    def type(self) -> str | None:
        """The `type` of the message, where it has one that is a string."""
        kind = self.members.get("type")
        return kind if isinstance(kind, str) else None

    @property
    def finite(self) -> bool:
        """Its numbers are, and so can be written again."""
        return all(it.code not in ("not-finite", "overflows") for it in self.faults)

    @property
    def agrees(self) -> bool:
        """It is a `welcome`, and not one to 1.0, with which nothing is agreed (NEG-33)."""
        return self.kind == "welcome" and self.members.get("version") != "1.0"


@dataclass(eq=False)
class Conversation:
    """All that crossed one connection, messages in the order in which they were complete.

    What is asked of it is found once and kept: whoever judges one that grows has to take a copy.
    """

    channel: Channel
    number: int
    opened: float
    messages: "list[Message] | Row[Message]" = field(default_factory=list)
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

    def sent_by(self, peer: str) -> Sequence[Message]:
        """The messages of `client` or `server`."""
        return Picked(self.messages, self._places[1][peer])

    def of(self, *kinds: str) -> Sequence[Message]:
        """The messages of these kinds."""
        return Picked(self.messages, self._of(kinds))

    def placed(self, *kinds: str) -> Iterator["MessageInContext"]:
        """The messages of these kinds, or all, each with how far the negotiation had come."""
        (greeted, hello), (agreed, welcome) = self._negotiation
        places = self._of(kinds) if kinds else range(len(self.messages))
        messages = self.of(*kinds) if kinds else self.messages
        for place, message in zip(places, messages, strict=True):
            yield MessageInContext(
                message, hello if greeted < place else None, welcome if agreed < place else None
            )

    @property
    def hello(self) -> Message | None:
        """The first readable `hello`, if there is one."""
        return self._negotiation[0][1]

    @property
    def welcome(self) -> Message | None:
        """The first readable `welcome` to 1.1, if there is one."""
        return self._negotiation[1][1]

    def _of(self, kinds: Sequence[str]) -> Sequence[int]:
        """The places of the messages of these kinds."""
        found = [self._places[0][kind] for kind in kinds if kind in self._places[0]]
        return found[0] if len(found) == 1 else array("L", sorted(chain(*found)))

    @cached_property
    def _places(self) -> "tuple[dict[str | None, array[int]], dict[str, array[int]]]":
        """The places of messages among all, by kind and by sender."""
        kinds: dict[str | None, array[int]] = {}
        senders = {sender: array("L") for sender in SENDER.values()}
        for place, message in enumerate(self.messages):
            kinds.setdefault(message.kind, array("L")).append(place)
            senders[message.sender].append(place)
        return kinds, senders

    @cached_property
    def _negotiation(self) -> tuple[tuple[int, Message | None], tuple[int, Message | None]]:
        """The places of the first `hello` and `welcome`, and these; behind all if there is none."""
        behind: tuple[int, Message | None] = len(self.messages), None
        hellos = zip(self._of(["hello"]), self.of("hello"), strict=True)
        welcomes = zip(self._of(["welcome"]), self.of("welcome"), strict=True)
        return next(hellos, behind), next((it for it in welcomes if it[1].agrees), behind)


class MessageInContext(NamedTuple):
    """A message, and the first `hello` and `welcome` that came before it."""

    message: Message
    hello: Message | None
    welcome: Message | None


class Assembler:
    """A recording put together as it grows; with `shelved`, most of a long one on disk.

    Attributes:
        conversations: in the order in which they were opened.
    """

    def __init__(self, *, shelved: bool = False) -> None:
        self._shelf = Shelf(_plain, _made, _size) if shelved else None
        self.conversations: list[Conversation] = []
        self._by_key: dict[tuple[str, int], Conversation] = {}
        self._welcomed: set[tuple[str, int]] = set()

    def feed(self, entry: Entry) -> tuple[Conversation, list[Message]]:
        """Take what crossed next; the conversation that it is of, and what it completes there."""
        key = (entry.channel, entry.conn)
        conversation = self._by_key.get(key)
        if conversation is None:
            conversation = Conversation(
                entry.channel,
                entry.conn,
                entry.t,
                Row(self._shelf) if self._shelf else [],
                beside=self.conversations,
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
            conversation.messages.extend(completed)
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


def conversations(entries: Iterable[Entry], *, shelved: bool = False) -> list[Conversation]:
    """Put a recording together, connections in the order in which they were opened."""
    assembler = Assembler(shelved=shelved)
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


def _plain(it: Message) -> tuple[object, ...]:
    return it.direction, tuple(it.packet), it.value, [tuple(each) for each in it.faults], it.kind


def _made(kept: Any) -> Message:
    direction, packet, value, faults, kind = kept
    found = tuple(PayloadFault(*each) for each in faults)
    return Message(direction, Packet(*packet), value, found, kind)


def _size(it: Message) -> int:
    return len(it.packet.payload)
