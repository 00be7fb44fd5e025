"""Answers to nothing that was asked: what a server may have sent each for."""

from collections import defaultdict
from functools import lru_cache
from typing import NamedTuple

from splatbus_conformance.rules.exchanges import exchanges, valid_request
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.message_kinds import CLIENT_1_1, POSES, REPLY_TO, REQUESTS_1_0


class Blamed(NamedTuple):
    """A packet from the server that answers nothing."""

    answer: Message
    cause: Message | None
    """The message of the client that it was sent for, as far as that shows."""
    requirement: str
    """The one that it breaks."""


@lru_cache(maxsize=1)  # two rules ask for the same
def caused(conversation: Conversation) -> tuple[Blamed, ...]:
    """What answers nothing, each with the message that it was sent for, as far as that shows.

    A server answers in order. What comes when each request has its answer is about something that
    the client had sent since it last knew that; else it is one more answer to the last. Where that
    can be several messages, which are left alone by different sentences, or ids are not given back,
    it is one answer too many to all of them.
    """
    found = exchanges(conversation)
    negotiated = conversation.welcome is not None
    waits = {pair.answer.packet.offset: pair.question.packet.offset for pair in found.pairs}
    asked = {*waits.values(), *(message.packet.offset for message in found.unanswered)}
    extra = {it.answer.packet.offset: it.cause for it in found.extra}
    nameless = any(p.welcomed and not _is_named_as(p.answer, p.question) for p in found.pairs)
    told: list[Blamed] = []
    if not extra:
        return ()
    silent: defaultdict[str, list[Message]] = defaultdict(list)
    waiting, all_answered = 0, False
    for message in sorted(conversation.messages, key=lambda it: it.packet.ended):
        at = message.packet.offset
        if message.sender == "client":
            if all_answered:
                silent.clear()
                all_answered = False
            waiting += at in asked
            if message.value is None or message.faults or without_reply(message):
                silent[_blame(message, negotiated=negotiated)].append(message)
        elif at in waits:
            waiting -= 1
            all_answered = waiting == 0
        elif at in extra:
            causes = {
                requirement: first
                for requirement, messages in silent.items()
                if (first := next((it for it in messages if _may_be_for(message, it)), None))
                and (not negotiated or _is_named_as(message, first))
            }
            if nameless or len(causes) > 1 or (negotiated and not causes and extra[at]):
                told.append(Blamed(message, extra[at], "REQ-7"))
                continue
            cause = extra[at]
            for requirement, cause in causes.items():
                silent[requirement].remove(cause)
            told.append(Blamed(message, cause, _blame(cause, negotiated=negotiated)))
    return tuple(told)


def _is_named_as(answer: Message, message: Message) -> bool:
    """Whether an answer has the id of a message, if that can be read: else it is for another."""
    unread = message.value is None or bool(message.faults)
    return unread or answer.members.get("id") == message.members.get("id")


def _may_be_for(answer: Message, message: Message) -> bool:
    """Whether an answer is of a kind that this message, which has none, could have been given."""
    unread = message.value is None or bool(message.faults)
    return unread or answer.kind is None or REPLY_TO.get(message.kind or "") == answer.kind


def _blame(cause: Message | None, *, negotiated: bool) -> str:
    """The requirement that an answer breaks which a message must not have had."""
    if cause is None:
        return "CHN-11"
    if cause.value is None or cause.faults:
        return "JSN-8"
    if cause.kind in POSES:
        return "POS-10"
    if cause.kind in REQUESTS_1_0:
        return "REQ-7" if valid_request(cause) else "REQ-9"
    return "REQ-7" if negotiated else "REQ-8"


def without_reply(message: Message) -> str | None:
    """The requirement by which a client's message has no reply, where there is one."""
    if message.value is None:
        return None
    if message.kind in POSES:
        return "POS-10"
    if message.kind in REQUESTS_1_0:
        return None if valid_request(message) or message.faults else "REQ-9"
    return None if message.kind in CLIENT_1_1 else "REQ-8"
