"""Rules: what can be judged from bytes that have crossed the wire, without taking part (L0).

A rule is a function from one conversation to sightings. A sighting says that a requirement was
exercised, and how it was broken if it was. `audit` judges recordings by them, and every live
session of the harness is a recording too.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import cache, wraps
from typing import Any, NamedTuple, Protocol, cast

from splatbus_conformance.wire.conversation import Conversation, Message, conversations
from splatbus_conformance.wire.recording import Entry

Json = dict[str, Any]
LOST = "lost-a-vital-sign"
"""The code of what the testee could do when it was met, and can no more."""


class Breach(NamedTuple):
    """How a requirement was broken."""

    code: str
    """Which of the ways to break it this is, however the words put it."""
    words: str

    def __str__(self) -> str:
        return self.words


class Sighting(NamedTuple):
    """A requirement was exercised by a peer."""

    requirement: str
    peer: str
    """`client` or `server`: who was bound by it."""
    t: float
    breach: Breach | None = None
    """What was wrong; None if it was right."""
    pointer: str = ""
    """JSON Pointer into the message, where the breach has a place there."""
    message: Message | None = None
    offset: int = 0
    """Where the bytes that show it begin in their sender's stream, if they are no message."""
    data: bytes = b""
    """Those bytes."""
    channel: str = ""
    conn: int = 0
    """Of which connection, as `rule` adds."""


class Judgement(NamedTuple):
    """What one message shows of one requirement."""

    requirement: str
    breach: Breach | None = None
    pointer: str = ""


class Rule(Protocol):
    """A function from a conversation to sightings of the requirements that it judges."""

    __name__: str
    judges: tuple[str, ...]

    def __call__(self, conversation: Conversation) -> Iterable[Sighting]:
        """Judge."""


def rule(*judges: str) -> Callable[[Callable[[Conversation], Iterable[Sighting]]], Rule]:
    """Declare a function to be the rule for these requirements."""

    def declare(function: Callable[[Conversation], Iterable[Sighting]]) -> Rule:
        @wraps(function)
        def judge_all(conversation: Conversation) -> Iterator[Sighting]:
            channel, number = conversation.channel, conversation.number
            for sighting in function(conversation):
                yield sighting._replace(channel=channel, conn=number)

        judge_all.judges = judges  # type: ignore[attr-defined]
        return cast(Rule, judge_all)

    return declare


def about(
    message: Message,
    requirement: str,
    breach: Breach | None = None,
    pointer: str = "",
    *,
    peer: str | None = None,
) -> Sighting:
    """A sighting of what `peer` did, the sender of `message` unless it is named."""
    return Sighting(
        requirement,
        peer or message.sender,
        message.packet.ended,
        breach,
        pointer,
        message,
    )


def kept(judgements: Iterable[Judgement]) -> bool:
    """Whether none of them is a breach."""
    return not any(judgement.breach for judgement in judgements)


def greeted(conversation: Conversation, *kinds: str) -> Iterator[Message]:
    """The messages of these kinds that came after `hello`."""
    return (message for message, hello, _ in conversation.placed(*kinds) if hello is not None)


def deaf(conversation: Conversation) -> bool:
    """What the server sent could not be read to its end, so nobody knows what the client knew."""
    return conversation.streams["s2c"].refused is not None


def judged(message: Message, judgements: Iterable[Judgement]) -> Iterator[Sighting]:
    """One sighting for each requirement among the judgements: its first breach, if it has one."""
    first: dict[str, Judgement] = {}
    for judgement in judgements:
        requirement, breach, _ = judgement
        if requirement not in first or (breach is not None and first[requirement].breach is None):
            first[requirement] = judgement
    for requirement, breach, pointer in first.values():
        yield about(message, requirement, breach, pointer)


@cache
def all_rules() -> tuple[Rule, ...]:
    """Every rule, in the order of the specification's chapters, and of their modules."""
    from splatbus_conformance.rules.v1_0 import chn, frm, ini, jsn, pos, req_replies, req_requests
    from splatbus_conformance.rules.v1_1 import (
        cam,
        evo,
        img,
        mem,
        neg,
        neg_welcome,
        obj,
        opn,
        scn_vpt_png,
        tel,
    )

    modules = (
        *(frm, jsn, chn, ini, pos, req_requests, req_replies),
        *(neg, neg_welcome, mem, opn, img, cam, obj, scn_vpt_png),
        *(evo, tel),
    )
    named = (it for module in modules for it in vars(module).values())
    return tuple(it for it in named if hasattr(it, "judges"))


def sightings(entries: Iterable[Entry]) -> Iterator[Sighting]:
    """Judge a recording by every rule."""
    return judge(conversations(entries))


def judge(found: Iterable[Conversation]) -> Iterator[Sighting]:
    """Judge the conversations of a recording by every rule."""
    rules = all_rules()
    for conversation in found:
        for rule in rules:
            yield from rule(conversation)
