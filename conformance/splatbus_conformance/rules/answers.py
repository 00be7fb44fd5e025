"""Requests and their replies, matched.

Replies of 1.0 carry neither type nor id, so they are matched by order (REQ-7) and by what they
hold; after `welcome` also by id. An `error` without id may answer any request, or a pose: it is
kept in hand, and taken for the answer of a request that is passed over. Each step costs the same
however many requests wait.
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.conversation import Conversation, Message
from splatbus_conformance.kinds import REPLIES, REPLY_TO, REQUESTS, REQUESTS_1_0
from splatbus_conformance.rules import Judgement
from splatbus_conformance.rules.poses import typed
from splatbus_conformance.values import SAFE, integer_in, is_number, show, whole

ASKED_BY = {
    "get_viewport_size": "REQ-1",
    "get_camera_pose": "REQ-2",
    "get_scene": "SCN-1",
    "set_viewport": "VPT-1",
    "ping": "PNG-1",
}
"""The requirement on the form of each request."""
MAX_SIZE: int = LIMITS["max_image_size"]
Id = int | str | None
ANY = "any"


class Pair(NamedTuple):
    """A request and what answered it."""

    question: Message
    answer: Message
    late: int
    """Requests before it that had no answer yet, and no error that could be theirs."""
    asked_after_hello: bool
    welcomed: bool
    """The answer came after `welcome`."""
    certain: bool
    """The request breaks nothing."""


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


class _Pending(NamedTuple):
    """A request that waits for its answer."""

    question: Message
    certain: bool
    """It breaks nothing, so that it must be answered."""
    after_hello: bool
    id: Id
    """Its id; 1.0 knows none, agreed upon or not."""

    @property
    def kind(self) -> str:
        """The kind of reply that it asks for."""
        return REPLY_TO[self.question.kind or ""]


@dataclass
class _Queue:
    """The requests that wait, in order, and those that a later one's answer has overtaken."""

    waiting: deque[_Pending] = field(default_factory=deque)
    count: Counter[tuple[str, Id]] = field(default_factory=Counter)
    """How many wait, by kind of reply and id; by kind alone, with "any" for an id; by id alone."""
    overtaken: dict[tuple[str, Id], deque[_Pending]] = field(default_factory=dict)

    def add(self, pending: _Pending) -> None:
        self.waiting.append(pending)
        self.count.update(_names(pending))

    def reach(self, name: tuple[str, Id]) -> tuple[_Pending, list[_Pending]] | None:
        """Take the first that has this name, and those before it; None if none has."""
        if not self.count[name]:
            return None
        passed = []
        while name not in _names(self.waiting[0]):
            passed.append(self.next())
        return self.next(), passed

    def next(self) -> _Pending:
        """Take the first."""
        first = self.waiting.popleft()
        self.count.subtract(_names(first))
        return first

    def overtake(self, passed: Iterable[_Pending]) -> None:
        """Keep these in case that their answers come late."""
        for each in passed:
            self.overtaken.setdefault((each.kind, each.id), deque()).append(each)

    def late(self, answer: Message) -> _Pending | None:
        """Take the one that has been overtaken and that this answers."""
        found = self.overtaken.get((answer.kind or "", _id(answer)))
        return found.popleft() if found else None


def request(message: Message) -> Iterator[Judgement]:
    """What a request shows of the requirement on its form."""
    value = message.value or {}
    requirement = ASKED_BY[str(message.kind)]
    yield from typed(value, REQUESTS, requirement, "a request")
    numbers: dict[str, tuple[int, int]] = {}
    if message.kind == "get_camera_pose":
        numbers = {"cam_idx": (-SAFE, SAFE)}
    elif message.kind == "set_viewport":
        numbers = dict.fromkeys(("width", "height"), (1, MAX_SIZE))
    elif message.kind == "ping" and not is_number(value.get("t")):
        has = show(value["t"]) if "t" in value else "missing"
        yield Judgement(requirement, f"t is {has}, no number", "/t")
    for name, (low, high) in numbers.items():
        wrong = None
        if not integer_in(value.get(name), low, high):
            has = show(value[name]) if name in value else "missing"
            wrong = f"{name} is {has}, no integer from {low} to {high}"
        yield Judgement(requirement, wrong, f"/{name}")


def valid_request(message: Message) -> bool:
    """A request that breaks neither the requirement on its form nor a rule of its text."""
    sound = message.kind in REQUESTS and not message.faults
    return sound and all(judgement.breach is None for judgement in request(message))


@lru_cache(maxsize=1)  # each rule on replies asks for the same
def exchanges(conversation: Conversation) -> Exchanges:
    """Match the replies on a message connection, the whole of it, to its requests."""
    found = Exchanges()
    if conversation.channel != "msg":
        return found
    queue = _Queue()
    errors = 0
    agreed = conversation.welcome is not None
    cause: Message | None = None
    for message, hello, welcome in conversation.placed():
        if message.sender == "client":
            cause = message
            known = REQUESTS_1_0 if hello is None else REQUESTS
            if valid_request(message) and message.kind in known:
                certain = _certain(message, after_hello=hello is not None)
                certain = certain and (agreed or message.kind in REQUESTS_1_0)
                id = _id(message) if agreed and hello is not None else None
                queue.add(_Pending(message, certain, hello is not None, id))
            continue
        if message.kind == "error" and hello is None:
            continue
        asked = _asked(queue, message)
        if asked is not None:
            pending, passed = asked
            owed = [each for each in passed if each.certain]
            forgiven = len(owed) <= errors
            errors -= len(owed) if forgiven else 0
            queue.overtake(() if forgiven else owed)
            late = 0 if forgiven else len(owed)
            after_hello, welcomed = pending.after_hello, welcome is not None
            found.pairs.append(
                Pair(pending.question, message, late, after_hello, welcomed, pending.certain)
            )
        elif message.kind == "error":
            errors += 1
        elif message.kind in REPLIES or message.type is None:
            if message.value is not None:
                found.extra.append(Extra(message, cause))
                queue.overtake([queue.next()] if queue.waiting else ())
        elif hello is None:
            found.extra.append(Extra(message, None))
    left = [each.question for each in queue.waiting if each.certain]
    found.unanswered = left[errors:]
    return found


def _asked(queue: _Queue, answer: Message) -> tuple[_Pending, list[_Pending]] | None:
    """The request that a packet answers, and those before it that it passes over.

    A reply answers the first request of its kind, that with its id if there is one. What has no
    sign of any reply is a broken reply to the first request, and so is what cannot be read.
    """
    if answer.kind == "error":
        return queue.reach(("", _id(answer))) if "id" in (answer.value or {}) else None
    if answer.kind in REPLIES:
        name = str(answer.kind)
        reached = queue.reach((name, _id(answer))) or queue.reach((name, ANY))
        if reached is None and (late := queue.late(answer)) is not None:
            return late, []
        return reached
    return (queue.next(), []) if answer.type is None and queue.waiting else None


def _names(pending: _Pending) -> tuple[tuple[str, Id], ...]:
    return (pending.kind, pending.id), (pending.kind, ANY), ("", pending.id)


def _id(message: Message) -> Id:
    """The id of a message, 3.0 being the same as 3 (JSN-6); None if it has none."""
    value = message.value or {}
    number = whole(value.get("id"))
    return show(value["id"]) if number is None and "id" in value else number


def _certain(message: Message, *, after_hello: bool) -> bool:
    value = message.value or {}
    numbered = not after_hello or integer_in(value.get("id", 0), 0)
    return is_number(value.get("timestamp", 0)) and numbered
