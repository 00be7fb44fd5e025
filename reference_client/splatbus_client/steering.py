"""Poses and questions to a server, over all its connections on the message channel.

Nothing here waits or locks; the session does.
"""

from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from splatbus_wire.messages import (
    CameraPose,
    ErrorMessage,
    Hello,
    PointCloudPose,
    Request,
    ViewportSize,
)

from splatbus_client.events import MessageEvent, Refused, Replied
from splatbus_client.message_protocol import MessageProtocol


class ServerRefusedError(Exception):
    """The server answered a request with an error."""

    def __init__(self, error: ErrorMessage) -> None:
        super().__init__(f"the server answered {error.code}: {error.message}")
        self.error = error


@dataclass
class _Question:
    request: Request
    answer: "Future[Any]"
    ticket: int | None


class Steering:
    """Follows the connections of the message channel, one after the other.

    Args:
        hello: sent on each connection.
    """

    def __init__(self, hello: Hello) -> None:
        self._hello = hello
        self._machine: MessageProtocol | None = None
        self._poses: dict[type, CameraPose | PointCloudPose] = {}
        self._questions: list[_Question] = []

    def begin(self) -> MessageProtocol:
        """Return the machine of a new connection, with the newest poses and the open questions."""
        machine = self._machine = MessageProtocol(self._hello)
        for pose in self._poses.values():
            machine.pose(pose)
        self._questions = [q for q in self._questions if not q.answer.cancelled()]
        for question in self._questions:
            question.ticket = machine.ask(question.request)
        return machine

    def handle(self, event: MessageEvent) -> None:
        """Give an answer to those who wait for it."""
        match event:
            case Replied(ticket, answer):
                value = (
                    (answer.width, answer.height)
                    if isinstance(answer, ViewportSize)
                    else answer.pose
                )
                for future in self._answered(ticket):
                    future.set_result(value)
            case Refused(ticket, error):
                for future in self._answered(ticket):
                    future.set_exception(ServerRefusedError(error))

    def end(self) -> None:
        """Keep what is unanswered for the next connection."""
        self._machine = None
        for question in self._questions:
            question.ticket = None

    def close(self) -> None:
        """Give up what is unanswered: no connection will come."""
        for question in self._questions:
            question.answer.cancel()

    def pose(self, message: CameraPose | PointCloudPose) -> None:
        """Send a pose; it stays the newest of its kind for the connections to come.

        Raises:
            ProtocolError: the pose breaks POS-2 or POS-3.
        """
        (self._machine or MessageProtocol(self._hello)).pose(message)
        self._poses.pop(type(message), None)  # so that timestamps leave in order [POS-9]
        self._poses[type(message)] = message

    def ask(self, request: Request) -> "Future[Any]":
        """Ask on this connection, or on the next one."""
        ticket = None if self._machine is None else self._machine.ask(request)
        question = _Question(request, Future(), ticket)
        self._questions.append(question)
        return question.answer

    def _answered(self, ticket: int) -> "list[Future[Any]]":
        """Return the futures that wait for the ticket, and forget them."""
        answered = [q.answer for q in self._questions if q.ticket == ticket]
        self._questions = [q for q in self._questions if q.ticket != ticket]
        return [future for future in answered if future.set_running_or_notify_cancel()]
