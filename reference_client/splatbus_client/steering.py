"""Poses and questions to a server, over all its connections on the message channel.

Nothing here waits or locks; the session does.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from splatbus_schemas.visible import visible
from splatbus_wire.messages import CameraPose, ErrorMessage, Hello, Request
from splatbus_wire.superseding import subject, succeeding

from splatbus_client.events import (
    Measured,
    MessageEvent,
    Negotiated,
    NotOffered,
    Refused,
    Replied,
    ServerError,
)
from splatbus_client.message_protocol import MessageProtocol, NotOfferedError
from splatbus_client.outgoing import Told, checked

log = logging.getLogger("splatbus_client")

CAPABILITIES = ("intrinsics", "objects", "scene", "viewport", "time", "ping", "telemetry")
"""What this client can do on the message channel."""
TELEMETRY_KEPT = 256
TELEMETRY_BYTES = 4 << 20
"""Of packets; what they hold takes about ten times as much once it is read."""
TAGS_KEPT = 1024
MOST_QUESTIONS = 1024


class ServerRefusedError(Exception):
    """The server answered a request with an error; as a text it is fit for a terminal."""

    def __init__(self, error: ErrorMessage) -> None:
        super().__init__(visible(f"the server answered {error.code}: {error.message}"))
        self.error = error


@dataclass
class _Question:
    request: Request
    value: Callable[[Any], Any]
    answer: Future[Any]
    ticket: int | None = None


class Steering:
    """Follows the connections of the message channel, one after the other.

    Args:
        hello: sent on each connection, with the capabilities of this channel.
    """

    def __init__(self, hello: Hello) -> None:
        self.telemetry: deque[Measured] = deque(maxlen=TELEMETRY_KEPT)
        """What was not read yet; the oldest goes when there is more than that."""
        self._hello = hello._replace(capabilities=CAPABILITIES)
        self.machine: MessageProtocol | None = None
        self.newest: dict[object, Told] = {}
        self.questions: list[_Question] = []
        self._busy = False
        self._tags: deque[str] = deque(maxlen=TAGS_KEPT)
        self._later: deque[str] = deque(maxlen=TAGS_KEPT)
        self._taken: str | None = None
        self._said: set[str] = set()

    def begin(self) -> MessageProtocol:
        """Return the machine of a new connection, with what was told last and the open questions.

        A tag goes out once at most: an image that comes after a reconnect ends no wait.
        """
        machine = self.machine = MessageProtocol(self._hello)
        self._busy = False
        for key, message in self.newest.items():
            machine.tell(message)
            self.newest[key] = _untagged(message)
        self._forget_what_nobody_awaits()
        for question in self.questions:
            question.ticket = machine.ask(question.request)
        return machine

    def handle(self, event: MessageEvent) -> bool:
        """Give an answer to those who wait for it, and keep what else the server says.

        Returns:
            Whether it complains of a lens in the place of which another was taken already.
        """
        if isinstance(event, Negotiated):
            for message in self.newest.values():
                self._say_what_is_lacking(message)
        elif isinstance(event, Replied):
            for question in self.answered(event.ticket):
                question.answer.set_result(question.value(event.answer))
        elif isinstance(event, Refused):
            for question in self.answered(event.ticket):
                question.answer.set_exception(ServerRefusedError(event.error))
        elif isinstance(event, NotOffered):
            for question in self.answered(event.ticket):
                question.answer.set_exception(NotOfferedError(event.capability))
        elif isinstance(event, Measured):
            self.telemetry.append(event)
            while sum(measured.size for measured in self.telemetry) > TELEMETRY_BYTES:
                self.telemetry.popleft()
        elif isinstance(event, ServerError):
            if event.error.code == "busy":
                self._busy = True
            else:
                # Of lenses the newest may have been told before the former was refused.
                after = [*self._later][-1:] if event.error.pointer == "/intrinsics" else []
                self._later = deque(after, TAGS_KEPT)
                return after == [self._taken]
        return False

    def end(self) -> None:
        """Keep what is unanswered for the next connection."""
        self.machine = None
        self._busy = False
        for question in self.questions:
            question.ticket = None

    def close(self) -> None:
        """Give up what is unanswered: no connection will come."""
        for question in self.questions:
            question.answer.cancel()

    def tell(self, message: Told) -> None:
        """Send a message; it stays the newest of its kind for the connections to come.

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
        """
        if self.machine is None:
            checked(message)
        else:
            self.machine.tell(message)
        if isinstance(message, CameraPose) and message.tag is not None:
            self._tags.append(message.tag)
            self._later.append(message.tag)
        # Taken out first, so that timestamps leave in order [POS-9].
        former = self.newest.pop(subject(message), None)
        newest = succeeding(former, message)
        self.newest[subject(message)] = newest if self.machine is None else _untagged(newest)
        self._say_what_is_lacking(message)

    def ask(
        self, request: Request, value: Callable[[Any], Any] = lambda answer: answer
    ) -> Future[Any]:
        """Ask on this connection, or on the next one; `value` makes the future's of the `Answer`.

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
            RuntimeError: too many questions are unanswered.
        """
        self._forget_what_nobody_awaits()
        if len(self.questions) >= MOST_QUESTIONS:
            raise RuntimeError(f"{len(self.questions)} questions are unanswered: cancel some first")
        question = _Question(request, value, Future())
        try:
            if self.machine is None:
                checked(request)
            else:
                question.ticket = self.machine.ask(request)
            self.questions.append(question)
        except NotOfferedError as problem:
            question.answer.set_exception(problem)
        return question.answer

    def _forget_what_nobody_awaits(self) -> None:
        dropped = {q.ticket for q in self.questions if q.answer.cancelled()}
        if dropped:
            self.questions = [q for q in self.questions if not q.answer.cancelled()]
            shared = {q.ticket for q in self.questions}
            if self.machine is not None:
                self.machine.withdraw(dropped - shared)

    def shown(self, tag: str | None) -> bool:
        """Take note that an image was rendered with the pose that has this tag [CAM-2].

        If it is ours, we have control again: the server says only when we have not [CTL-2].

        Returns:
            Whether what the server complained of last is over: a pose told since was taken, or any
            of ours where it was that another has control.
        """
        if tag in self._tags:
            self._busy, self._taken = False, tag
        return tag in self._later

    def lacks(self, message: Told) -> str | None:
        """Return the capability that the server lacks for a message, if that is known."""
        return None if self.machine is None else self.machine.lacks(message)

    @property
    def no_effect(self) -> str | None:
        """Why what was told last has no effect on the images, or not all of it, where known."""
        if self._busy:
            return "another client has control, and keeps it until it leaves [CTL-1]"
        lacking = {self.lacks(message) for message in self.newest.values()} - {None}
        if lacking:
            return f"the server does not offer {', '.join(sorted(map(repr, lacking)))} [NEG-5]"
        return None

    def _say_what_is_lacking(self, message: Told) -> None:
        capability = self.lacks(message)
        if capability is not None and capability not in self._said:
            self._said.add(capability)
            log.warning("the server does not offer %r: it is not told what needs that", capability)

    def answered(self, ticket: int) -> list[_Question]:
        """Return the questions that wait for the ticket, and forget them."""
        answered = [q for q in self.questions if q.ticket == ticket]
        self.questions = [q for q in self.questions if q.ticket != ticket]
        return [q for q in answered if q.answer.set_running_or_notify_cancel()]


def _untagged(message: Told) -> Told:
    return message._replace(tag=None) if isinstance(message, CameraPose) else message
