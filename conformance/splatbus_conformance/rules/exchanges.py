"""Requests and their replies, matched.

Replies of 1.0 carry neither type nor id, so they are matched by order (REQ-7) and by what they
hold; after `welcome` also by id. What an `error` is about its bytes need not say: without an id, a
request without one, a pose, or anything else; with an id, any message that had it. So every way is
followed in which a server that keeps the rules can have come to what it sent: it breaks one where
none is left, and what is the same answer in all of them is a pair.
"""

from bisect import bisect_left
from collections import Counter, defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from splatbus_conformance.rules import Judgement, kept
from splatbus_conformance.rules.form import form
from splatbus_conformance.wire.conversation import Conversation, Message, MessageInContext
from splatbus_conformance.wire.json_values import is_number, show, whole
from splatbus_conformance.wire.message_kinds import REPLIES, REPLY_TO, REQUESTS, REQUESTS_1_0

ASKED_BY = {
    "get_viewport_size": "REQ-1",
    "get_camera_pose": "REQ-2",
    "get_scene": "SCN-1",
    "set_viewport": "VPT-1",
    "ping": "PNG-1",
}
"""The requirement on the form of each request."""
Id = int | str | None
ANY = "any"
MOST_WAYS = 256
"""Ways that are followed; with more nothing further is matched."""
MOST_OVERTAKEN = 100
"""Requests that are kept in case that their answers come late."""


class Exchange(NamedTuple):
    """A request and what answered it."""

    question: Message
    answer: Message
    late: int
    """Requests before it that had no answer yet."""
    asked_after_hello: bool
    welcomed: bool
    """The answer came after `welcome`."""
    certain: bool
    """The request breaks nothing, and no other can have been answered so; else it is the first of
    those that can."""


class Extra(NamedTuple):
    """A packet from the server that answers nothing."""

    answer: Message
    cause: Message | None
    """The client's last message before it."""


@dataclass
class Exchanges:
    """What became of the requests of one connection."""

    pairs: list[Exchange] = field(default_factory=list)
    extra: list[Extra] = field(default_factory=list)
    astray: list[Message] = field(default_factory=list)
    """Each `error` with an id that no request has which can have waited for it."""
    unanswered: list[Message] = field(default_factory=list)
    """Valid requests without an answer."""


class _Answer(NamedTuple):
    """What a packet from the server can be."""

    message: Message
    kind: str | None
    """Of reply, or `error`; None for what has no sign of any reply, and so is a broken one."""
    id: Id
    """"any" where it breaks NEG-23."""
    welcomed: bool


class _Asked(NamedTuple):
    """A valid request."""

    question: Message
    certain: bool
    """It breaks nothing, so that it must be answered."""
    after_hello: bool
    welcomed: bool
    """It was sent after `welcome`, so that an `error` about it has its id."""
    ids: frozenset[Id] | None
    """What its answer may have for an id; None for anything."""

    @property
    def kind(self) -> str:
        """The kind of reply that it asks for."""
        return REPLY_TO[self.question.kind or ""]

    def fits(self, answer: _Answer) -> bool:
        """Whether it may be answered so."""
        if answer.kind is None:
            return True
        vague = answer.kind == "error" and (
            answer.id == ANY or (answer.id is None and not self.welcomed)
        )
        named = vague or self.ids is None or answer.id in self.ids
        return named and answer.kind in (self.kind, "error")


class _Matching:
    """The requests of one connection, and how far the server can have come in answering them.

    Attributes:
        found: what is known of them.
        heads: the requests that are answered or passed over, counted in each way that is open.
    """

    def __init__(self) -> None:
        self.found = Exchanges()
        self.heads = {0}
        self._requests: list[_Asked] = []
        self._owed = [0]
        """Before each request, how many must be answered."""
        self._at: defaultdict[tuple[str, Id], list[int]] = defaultdict(list)
        """The places of requests, by kind and id; by kind alone; by id alone."""
        self._overtaken: deque[int] = deque(maxlen=MOST_OVERTAKEN)
        """The places of requests that a later one's answer has overtaken."""
        self._others: Counter[Id] = Counter()
        """What else an `error` may be about, by id; by "any" where the id is in doubt."""
        self._answers: Counter[Id] = Counter()
        """What is matched, by id."""
        self._cause: Message | None = None

    def hear(self, message: Message, asked: _Asked | None) -> None:
        """Take what the client sent, which is a valid request or something else."""
        self._cause = message
        if asked is None:
            twice = any(fault.requirement == "JSN-3" for fault in message.faults)
            clear = message.value is not None and _named_well(message) and not twice
            self._others[_id(message) if clear else ANY] += 1
            return
        place = len(self._requests)
        self._requests.append(asked)
        self._owed.append(self._owed[-1] + asked.certain)
        self._at[asked.kind, ANY].append(place)
        if asked.ids is None:
            self._others[ANY] += 1
        for id in asked.ids or ():
            self._at[asked.kind, id].append(place)
            self._at["", id].append(place)

    def take(self, answer: _Answer) -> None:
        """Take what the server sent."""
        places = self._open(answer)
        after = {place + 1 for place in places}
        self._answers[answer.id] += 1
        if answer.kind == "error":
            after = {head for head in after | self.heads if self._accounted(answer.id, head)}
        if not after:
            self._answers[answer.id] -= 1
            self._take_amiss(answer)
            return
        kinds = {self._requests[place].question.kind for place in places}
        if len(kinds) == 1 and not (answer.kind == "error" and after & self.heads):
            late = any(self._requests[place].fits(answer) for place in self._overtaken)
            self._pair(answer, *places, certain=not late)
        self.heads = after

    def stray(self, message: Message) -> None:
        """Take what the server sent that is nothing which it may send."""
        self.found.extra.append(Extra(message, None))

    def finish(self) -> Exchanges:
        """What is known, nothing more having come."""
        left = self._requests[max(self.heads) :]
        self.found.unanswered = [asked.question for asked in left if asked.certain]
        return self.found

    def _open(self, answer: _Answer) -> list[int]:
        """The places of the requests that this may answer, none before them being left out."""
        places, seen = [], 0
        for head in sorted(self.heads):
            for place in range(head, len(self._requests) if head >= seen else head):
                seen = place + 1
                if self._requests[place].fits(answer):
                    places.append(place)
                if self._requests[place].certain:
                    break
        return places

    def _accounted(self, id: Id, head: int) -> bool:
        """There are no more answers with this id than the messages before `head` that had it, and
        others that are no requests.
        """
        asked = bisect_left(self._at["", id], head)
        others = self._others[id] + self._others[ANY]
        return id in (None, ANY) or self._answers[id] <= asked + others

    def _take_amiss(self, answer: _Answer) -> None:
        """Take what cannot be an answer in its turn: to a later request, a former one, or none."""
        kind = "" if answer.kind == "error" else answer.kind or ANY
        for id in (answer.id,) if answer.kind == "error" else (answer.id, ANY):
            if reached := self._reach(kind, id):
                late, place, head = reached
                passed = [it for it in range(head, place) if self._requests[it].certain]
                self._overtaken += passed
                self._answers[id] += 1
                self._pair(answer, place, late=late)
                self.heads = {place + 1}
                return
        for place in self._overtaken:
            if self._requests[place].fits(answer):
                self._overtaken.remove(place)
                self._pair(answer, place)
                return
        if answer.kind == "error":
            self.found.astray.append(answer.message)
        elif answer.message.value is not None:
            self.found.extra.append(Extra(answer.message, self._cause))
            # It may have been meant for the next.
            self.heads |= {head + 1 for head in self.heads if head < len(self._requests)}

    def _reach(self, kind: str, id: Id) -> tuple[int, int, int] | None:
        """How many requests are left out before the first of this name, its place, and since."""
        ways, places = [], self._at[kind, id]
        for head in self.heads:
            if (i := bisect_left(places, head)) < len(places):
                ways.append((self._owed[places[i]] - self._owed[head], places[i], head))
        return min(ways, default=None)

    def _pair(self, answer: _Answer, *places: int, late: int = 0, certain: bool = True) -> None:
        asked = [self._requests[place] for place in places]
        first, after_hello = asked[0], all(each.after_hello for each in asked)
        certain = certain and len(asked) == 1 and first.certain
        self.found.pairs.append(
            Exchange(first.question, answer.message, late, after_hello, answer.welcomed, certain)
        )


def request(message: Message) -> Iterator[Judgement]:
    """What a request shows of the requirement on its form."""
    kind = str(message.kind)
    return form(message.members, kind, ASKED_BY[kind])


def valid_request(message: Message) -> bool:
    """A request that breaks neither the requirement on its form nor a rule of its text."""
    sound = message.kind in REQUESTS and not message.faults
    return sound and kept(request(message))


@lru_cache(maxsize=1)  # each rule on replies asks for the same
def exchanges(conversation: Conversation) -> Exchanges:
    """Match the replies on a message connection, the whole of it, to its requests."""
    matching = _Matching()
    if conversation.channel != "msg":
        return matching.found
    agreed = conversation.welcome is not None
    for placed in conversation.placed():
        message, hello, welcome = placed
        if message.sender == "client":
            matching.hear(message, _asked(placed, agreed=agreed))
        elif message.kind == "error" and hello is None:
            continue
        elif message.kind in (*REPLIES, "error") or message.type is None:
            kind = message.kind if message.kind in (*REPLIES, "error") else None
            id = _id(message) if agreed and kind is not None else None
            if kind == "error" and not _named_well(message):
                id = ANY
            matching.take(_Answer(message, kind, id, welcome is not None))
        elif hello is None:
            matching.stray(message)
        if len(matching.heads) > MOST_WAYS:
            return matching.found
    return matching.finish()


def _asked(placed: MessageInContext, *, agreed: bool) -> _Asked | None:
    message, hello, welcome = placed
    if not valid_request(message) or message.kind not in (REQUESTS if hello else REQUESTS_1_0):
        return None
    sure = is_number(message.members.get("timestamp", 0))
    sure = sure and (agreed or message.kind in REQUESTS_1_0)
    ids: frozenset[Id] | None = frozenset({None})
    if agreed and hello is None:  # its reply may come before `welcome`, or after
        ids = frozenset({None, _id(message)})
    elif agreed:
        ids = frozenset({_id(message)}) if _named_well(message) else None
    sure = sure and (hello is None or _named_well(message))
    return _Asked(message, sure, hello is not None, welcome is not None, ids)


def _named_well(message: Message) -> bool:
    """It has an id that NEG-27 allows, or none."""
    return whole(message.members.get("id", 0), 0) is not None


def _id(message: Message) -> Id:
    """The id of a message, 3.0 being the same as 3 (JSN-6); None if it has none."""
    value = message.members
    number = whole(value.get("id"))
    return show(value["id"]) if number is None and "id" in value else number
