"""Requests and their replies, matched.

Replies of 1.0 carry neither type nor id, so they are matched by order (REQ-7) and by what they
hold; after `welcome` also by id. An `error` without id may answer any request, or a pose: it is
kept in hand, and taken for the answer of a request that is passed over.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from splatbus_conformance.conversation import Conversation, Message, placed
from splatbus_conformance.kinds import REPLIES, REQUESTS
from splatbus_conformance.rules import Judgement
from splatbus_conformance.values import SAFE, integer_in, is_number, show

REPLY_TO = dict(zip(REQUESTS, REPLIES, strict=True))


class Pair(NamedTuple):
    """A request and what answered it."""

    question: Message
    answer: Message
    late: int
    """Requests before it that had no answer yet, and no error that could be theirs."""
    asked_after_hello: bool
    welcomed: bool
    """The answer came after `welcome`."""


class Extra(NamedTuple):
    """A packet from the server that answers nothing."""

    answer: Message
    cause: Message | None
    """The client's last message before it."""


@dataclass
class Exchanges:
    """What became of the requests of one connection."""

    pairs: list[Pair] = field(default_factory=list)
    extra: list[Extra] = field(default_factory=list)
    unanswered: list[Message] = field(default_factory=list)
    """Valid requests without an answer."""


@dataclass
class _Pending:
    question: Message
    certain: bool
    """The request breaks nothing, so that it must be answered."""
    after_hello: bool
    blamed: bool = False
    """A breach for this request has been found already."""

    def is_answered_by(self, answer: Message) -> bool:
        """It is a reply of the kind that was asked for."""
        return answer.kind == REPLY_TO[self.question.kind or ""]

    def has_the_id_of(self, answer: Message) -> bool:
        """Both have the same id, or none."""
        return (self.question.value or {}).get("id") == (answer.value or {}).get("id")


def request(message: Message) -> Iterator[Judgement]:
    """What a request shows of REQ-1 and REQ-2."""
    value = message.value or {}
    requirement = "REQ-1" if message.kind == "get_viewport_size" else "REQ-2"
    wrong = None
    if message.type not in REQUESTS:
        kind = show(value["type"]) if "type" in value else "missing"
        wrong = f"type is {kind} in what is else a request"
    yield Judgement(requirement, wrong, "/type")
    if message.kind == "get_camera_pose":
        index = value.get("cam_idx")
        text = f"cam_idx is {show(index)}, no integer from {-SAFE} to {SAFE}"
        if "cam_idx" not in value:
            text = "cam_idx is missing"
        yield Judgement("REQ-2", None if integer_in(index, -SAFE) else text, "/cam_idx")


def valid_request(message: Message) -> bool:
    """A request that breaks neither REQ-1, REQ-2 nor a rule of its text."""
    sound = message.kind in REQUESTS and not message.faults
    return sound and all(judgement.breach is None for judgement in request(message))


def exchanges(conversation: Conversation) -> Exchanges:
    """Match the replies on a message connection to its requests."""
    found = Exchanges()
    if conversation.channel != "msg":
        return found
    pending: list[_Pending] = []
    errors = 0
    cause: Message | None = None
    for message, hello, welcome in placed(conversation):
        if message.sender == "client":
            cause = message
            if valid_request(message):
                pending.append(_Pending(message, _certain(message), hello is not None))
        elif message.value is None:
            if pending:
                spoiled = pending.pop(0)
                found.pairs.append(_pair(spoiled, message, 0, welcome))
        elif message.kind == "error":
            errors += hello is not None and not _take_by_id(pending, message)
        elif message.kind not in REPLIES and message.type is not None:
            if hello is None:
                found.extra.append(Extra(message, None))
        elif (index := _asked(pending, message)) is None:
            found.extra.append(Extra(message, cause))
            if pending:
                pending[0].blamed = True
        else:
            passed = [p for p in pending[:index] if p.certain and not p.blamed]
            forgiven = len(passed) <= errors
            errors -= len(passed) if forgiven else 0
            found.pairs.append(
                _pair(pending[index], message, 0 if forgiven else len(passed), welcome)
            )
            for each in passed:
                each.blamed = True
            kept = [] if forgiven else [p for p in pending[:index] if p.certain]
            pending[: index + 1] = kept
    left = [p.question for p in pending if p.certain and not p.blamed]
    found.unanswered = left[errors:]
    return found


def _pair(asked: _Pending, answer: Message, late: int, welcome: Message | None) -> Pair:
    return Pair(asked.question, answer, late, asked.after_hello, welcome is not None)


def _certain(message: Message) -> bool:
    value = message.value or {}
    return is_number(value.get("timestamp", 0)) and integer_in(value.get("id", 0), 0)


def _asked(pending: list[_Pending], answer: Message) -> int | None:
    """Which pending request a reply answers: of its kind, and with its id where one has it.

    What has no sign of any reply is a broken reply to the first.
    """
    if answer.kind not in REPLIES:
        return next((i for i, p in enumerate(pending) if not p.blamed), None)
    of_kind = [i for i, p in enumerate(pending) if p.is_answered_by(answer)]
    of_id = [i for i in of_kind if pending[i].has_the_id_of(answer)]
    return next(iter([*of_id, *of_kind]), None)


def _take_by_id(pending: list[_Pending], error: Message) -> bool:
    if "id" in (error.value or {}):
        for i, each in enumerate(pending):
            if each.has_the_id_of(error):
                del pending[i]
                return True
    return False
