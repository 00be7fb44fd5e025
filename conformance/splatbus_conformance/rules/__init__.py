"""Rules: what can be judged from bytes that have crossed the wire, without taking part (L0).

A rule is a function from one conversation to sightings. A sighting says that a requirement was
exercised, and how it was broken if it was. `audit` judges recordings by them, and every live
session of the harness is a recording too.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, Protocol, cast

from splatbus_conformance.wire.conversation import Conversation, Message, conversations
from splatbus_conformance.wire.recording import Entry

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
    channel: str
    conn: int
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
        function.judges = judges  # type: ignore[attr-defined]
        return cast(Rule, function)

    return declare


def about(
    conversation: Conversation,
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
        conversation.channel,
        conversation.number,
        message.packet.ended,
        breach,
        pointer,
        message,
    )


def judged(
    conversation: Conversation, message: Message, judgements: Iterable[Judgement]
) -> Iterator[Sighting]:
    """One sighting for each requirement among the judgements: its first breach, if it has one."""
    first: dict[str, Judgement] = {}
    for judgement in judgements:
        requirement, breach, _ = judgement
        if requirement not in first or (breach is not None and first[requirement].breach is None):
            first[requirement] = judgement
    for requirement, breach, pointer in first.values():
        yield about(conversation, message, requirement, breach, pointer)


def all_rules() -> tuple[Rule, ...]:
    """Every rule, in the order of the specification's chapters."""
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
    return tuple(rule for module in modules for rule in module.RULES)


def sightings(entries: Iterable[Entry]) -> Iterator[Sighting]:
    """Judge a recording by every rule."""
    return judge(conversations(entries))


def judge(found: Iterable[Conversation]) -> Iterator[Sighting]:
    """Judge the conversations of a recording by every rule."""
    rules = all_rules()
    for conversation in found:
        for rule in rules:
            yield from rule(conversation)
