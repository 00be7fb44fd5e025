"""The message channel, sans I/O: bytes in, events out, bytes to send (1.0 chapter 6; 1.1).

Requests go out one at a time. Replies of 1.0 carry no id, so a reply that cannot be understood
could otherwise make every later one answer the wrong request [REQ-11].
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator
from itertools import count

from splatbus_schemas import LIMITS
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.messages import (
    ErrorMessage,
    GetCameraPose,
    GetScene,
    GetViewportSize,
    Hello,
    Ping,
    Pong,
    Reply,
    Request,
    SetViewport,
    SubscribeTelemetry,
    Telemetry,
    ViewportSize,
    Welcome,
    decode_from_server_message,
    encode,
    message_object,
)
from splatbus_wire.packet_reader import PacketReader
from splatbus_wire.superseding import subject, succeeding

from splatbus_client.clock import Sample
from splatbus_client.events import (
    Answer,
    Ignored,
    Measured,
    MessageEvent,
    MustClose,
    Negotiated,
    NotOffered,
    Refused,
    Replied,
    ServerError,
    negotiated,
)
from splatbus_client.outgoing import (
    Told,
    checked,
    needs,
    only_1_1,
    permitted,
)

# The limits bind as the server sees them, and its clock and scheduler are not ours.
REPLY_SECONDS: float = 0.9 * LIMITS["reply_seconds"]
ASK_AGAIN_SECONDS: float = 1.25 * LIMITS["ask_again_min_seconds"]

_QUESTIONS = (GetViewportSize, GetCameraPose, GetScene)


class NotOfferedError(Exception):
    """The server lacks a capability, without which a request may not be sent [NEG-5]."""

    def __init__(self, capability: str) -> None:
        super().__init__(f"the server does not offer the capability {capability!r} [NEG-5]")
        self.capability = capability


class MessageProtocol:
    """One connection on the message channel, from `hello` to its end.

    Times are seconds of any one clock that never goes back.

    Args:
        hello: sent first [NEG-1]; a request for the viewport's size follows it, because its reply
            tells a server of 1.0, which ignores `hello`, from a later one [NEG-13, NEG-39].
    """

    def __init__(self, hello: Hello) -> None:
        self.version: str | None = None
        self.capabilities: frozenset[str] = frozenset()
        self.hello = hello
        self.reader = PacketReader()
        self.unsent = bytearray(encode(hello))
        self._tickets: Iterator[int] = count()
        self._queue: deque[tuple[int, Request]] = deque()
        self.asked: tuple[int, Request] | None = None  # as it was sent, with its id if it had one
        self._reply_due = 0.0
        self._ask_from: dict[type[Request], float] = {}
        self._told: dict[object, Told] = {}
        self._subscribed = False  # to telemetry, and be it none: some may be under way
        self.ask(GetViewportSize())

    def ask(self, request: Request) -> int:
        """Queue a request and return the ticket of its reply.

        A question that equals one which was not sent yet shares that one's ticket. One that was
        sent may be answered with what was true before this one was asked.

        Raises:
            NotOfferedError: the server is known to lack the capability.
            ProtocolError: a server would refuse it, for the requirement that is named.
        """
        request = checked(request)
        if (capability := self.lacks(request)) is not None:
            raise NotOfferedError(capability)
        if isinstance(request, _QUESTIONS):
            for ticket, unsent in self._queue:
                if _name(unsent) == _name(request) and unsent == request:
                    return ticket
        ticket = next(self._tickets)
        self._queue.append((ticket, request))
        return ticket

    def tell(self, message: Told) -> None:
        """Send a message with the next data; it replaces one of its kind that is unsent [POS-7].

        What 1.0 does not know waits until it is settled whether the server does, and whatever was
        told later waits behind it; then as much is sent as was agreed [NEG-5].

        Raises:
            ProtocolError: a server would refuse it, for the requirement that is named.
        """
        message = checked(message)
        # Taken out first, so that timestamps leave in order [POS-9].
        former = self._told.pop(subject(message), None)
        self._told[subject(message)] = succeeding(former, message)

    def lacks(self, message: Told | Request) -> str | None:
        """Return the capability that keeps a message or a part of it from being sent, if known."""
        capability = needs(message)
        if self.version is None or capability in self.capabilities:
            return None
        return capability

    def data_to_send(self, now: float) -> bytes:
        """Return what is to be sent next; call it again when that has been sent whole."""
        self._send_request(now)
        self._send_told()
        data = bytes(self.unsent)
        self.unsent.clear()
        return data

    def deadline(self) -> float:
        """Return when `expire` or `data_to_send` is to be called next, if nothing comes before."""
        asks = min((self._may_ask_from(request) for _, request in self._queue), default=math.inf)
        return min(self.reader.deadline, asks if self.asked is None else self._reply_due)

    def expire(self, now: float) -> list[MessageEvent]:
        """Return what follows from the time alone [FRM-5, CHN-15]."""
        if self.asked is not None and now >= self._reply_due:
            return [
                MustClose(f"no reply to {_name(self.asked[1])} within {REPLY_SECONDS:g} s [CHN-15]")
            ]
        if now >= self.reader.deadline:
            return [MustClose("a packet was begun and not completed in time [FRM-5]")]
        return []

    def receive(self, data: bytes, now: float) -> Iterator[MessageEvent]:
        """Yield what the bytes mean; `MustClose`, if any, is the last.

        Act on each event before taking the next: what a packet means can depend on it.
        """
        try:
            self.reader.receive(data, now)
            for payload in self.reader.packets(now):
                for event in self.on_payload(payload, now):
                    yield event
                    if isinstance(event, MustClose):
                        return
        except FramingError as error:
            yield MustClose(str(error))

    def _send_request(self, now: float) -> None:
        """Send the first request that may be sent, if none is unanswered."""
        ready = next((item for item in self._queue if self._may_ask(item[1], now)), None)
        if self.asked is not None or ready is None:
            return
        self._queue.remove(ready)
        ticket, request = ready
        if isinstance(request, Ping):
            request = request._replace(t=now)  # not when it was asked: it may have queued since
        if self.version == "1.1":
            # An error that answers the request is told by its id from one that reports a pose.
            request = request._replace(id=ticket)
        self.asked = (ticket, request)
        self._reply_due = now + REPLY_SECONDS
        self.unsent += encode(request)

    def _may_ask(self, request: Request, now: float) -> bool:
        if now < self._may_ask_from(request):
            return False
        return self.version is not None or not only_1_1(request)

    def _may_ask_from(self, request: Request) -> float:
        return self._ask_from.get(type(request), 0.0)

    def _send_told(self) -> None:
        for key, message in list(self._told.items()):
            if self.version is None and only_1_1(message):
                return
            del self._told[key]
            sent = permitted(message, self.version, self.capabilities)
            if sent is not None:
                self.unsent += encode(sent)
                self._subscribed |= isinstance(sent, SubscribeTelemetry)

    def on_payload(self, payload: bytes, now: float) -> Iterator[MessageEvent]:
        """Yield what a packet means."""
        request = None if self.asked is None else self.asked[1]
        try:
            message = decode_from_server_message(payload, request)
        except ProtocolError as problem:
            # Whatever it was, the request that waits is still unanswered: if nothing else comes,
            # its time runs out and the connection with it, rather than its order [REQ-13].
            yield Ignored(str(problem))
            return
        if isinstance(message, Welcome):
            yield from self.on_welcome(message)
        elif isinstance(message, ErrorMessage):
            if message.code == "busy" and isinstance(request, SetViewport):
                self._ask_from[SetViewport] = now + ASK_AGAIN_SECONDS  # [VPT-9]
            yield from self.on_error(message)
        elif isinstance(message, Telemetry):
            yield self._on_telemetry(message, len(payload))
        else:
            yield from self.on_reply(message, now)

    def on_welcome(self, welcome: Welcome) -> Iterator[MessageEvent]:
        """Settle the version, unless a reply has settled it [NEG-16, NEG-40]."""
        if self.version != "1.0" and welcome.version not in self.hello.versions:
            yield MustClose(f"welcome names version {welcome.version}, not offered [NEG-16]")
        elif self.version is not None:
            yield Ignored("welcome came when the version was settled [NEG-40]")
        else:
            yield from self._settle(negotiated(self.hello, welcome))

    def _settle(self, negotiated: Negotiated) -> Iterator[MessageEvent]:
        self.version, self.capabilities = negotiated.version, negotiated.capabilities
        yield negotiated
        for item in list(self._queue):
            ticket, request = item
            if (capability := self.lacks(request)) is not None:
                self._queue.remove(item)
                yield NotOffered(ticket, capability)

    def _on_telemetry(self, telemetry: Telemetry, size: int) -> MessageEvent:
        if not self._subscribed:
            return Ignored("telemetry came, which was not subscribed to [TEL-3]")
        return Measured(telemetry, size)

    def withdraw(self, tickets: Collection[int | None]) -> None:
        """Do not send the requests that have these tickets, if that can still be helped."""
        self._queue = deque(item for item in self._queue if item[0] not in tickets)

    def on_reply(self, reply: Reply, now: float) -> Iterator[MessageEvent]:
        """Give the request that waits its answer; one that came first was of 1.0."""
        assert self.asked is not None  # or it would not have been decoded as a reply
        if self.version is None:
            yield from self._settle(Negotiated("1.0", None, frozenset()))
        (ticket, request), self.asked = self.asked, None
        if isinstance(reply, ViewportSize) and reply.width * reply.height == 0:
            self._ask_from[GetViewportSize] = now + ASK_AGAIN_SECONDS  # [REQ-12]
        answer: Answer
        if isinstance(reply, Pong):
            assert isinstance(request, Ping)
            answer = Sample(request.t, reply.server_time, now)
        else:
            answer = reply
        yield Replied(ticket, answer)

    def on_error(self, error: ErrorMessage) -> Iterator[MessageEvent]:
        """Tell an error that answers the request that waits from any other."""
        # An error without id, while the request that went out before `welcome` waits, may mean
        # that one or a pose. Taking it for the former is harmless: later replies carry ids.
        # No request that goes without an id is answered `busy`, though.
        about_a_pose = error.code == "busy" and error.id is None
        if self.asked is None or error.id != self.asked[1].id or about_a_pose:
            yield ServerError(error)
            return
        ticket, self.asked = self.asked[0], None
        yield Refused(ticket, error)


def _name(request: Request) -> str:
    return str(message_object(request)["type"])
