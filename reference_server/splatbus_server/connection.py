"""One connection without its socket: bytes and moments in, events and bytes out.

Here stands what holds for every connection whatever its messages mean: framing, negotiation, what
is ignored and what is answered with an error, how much may wait unsent, and every deadline. No
clock and no socket: a moment is a number of seconds that the caller reads off a monotonic clock.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple, Union

from splatbus_schemas import LIMITS, VERSIONS
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.framing import MAX_PAYLOAD_BYTES, seems
from splatbus_wire.messages import (
    Channel,
    ClientMessage,
    ErrorMessage,
    Hello,
    Program,
    ServerMessage,
    Welcome,
    decode_from_client,
    encode,
)
from splatbus_wire.negotiation import answer_hello
from splatbus_wire.packet_reader import COMPLETION_SECONDS, PacketReader

from splatbus_server.share import Share
from splatbus_server.states import OPEN, TURNS, State, Turn

REQUESTS = ("get_viewport_size", "get_camera_pose")
REQUESTS_1_1 = (*REQUESTS, "get_scene", "set_viewport", "ping")
"""What an `error` answers that has an `id`: one about a pose, say, answers no request [NEG-23]."""
LINGER_SECONDS: float = LIMITS["last_words_seconds"]
"""How long a connection that the server ends is still read from, so that the last packet arrives:
closing a socket with unread input resets it, and a reset discards what the peer has not read
[NEG-34]."""
SHORT_BYTES = 256
"""Payloads up to this long are decoded once while they repeat, as viewers do: the same request, the
same pose fifty times a second. Longer ones are not kept, so that nobody can fill the memory."""

FULL_BYTES = 1 << 18
"""Unsent, above which nothing more is taken from who does not read."""
LONG_BYTES = 1 << 16
REST_SECONDS = 0.5
"""After a payload of the greatest length, and less after a shorter one, down to none for one that
is not long: to read one takes milliseconds, which all others wait for."""


class Terms(NamedTuple):
    """What a server negotiates with: its name, what it can do on each channel, its token."""

    server: Program
    capabilities: Mapping[Channel, tuple[str, ...]]
    token: str | None = None


class Refusal(NamedTuple):
    """A packet that is not acted upon.

    Attributes:
        code: of the `error` that says so.
        reason: for people.
        pointer: JSON Pointer to what is wrong in the message.
        id: of the request, if that had one [NEG-27].
    """

    code: str
    reason: str
    pointer: str | None = None
    id: int | None = None


Event = Union[ClientMessage, Refusal]


class Connection:
    """The state of one connection: feed it with `receive`, then take events until there are none.

    Attributes:
        unsent: bytes to hand to TCP next; tell `sent` how many it took.
        program: what the client says that it is.
        welcome: what was negotiated; None while the connection speaks 1.0, as agreed or not.
        input_ended: the client has ended its stream.
        ending: why no more is read from this connection; None while it is served.
        is_held: it has a request whose reply takes time; what it sent after that waits [NEG-29].
        share: of the thread's time.
        is_known: it has sent something valid [CHN-25].
        state: in which of its states it is.
        reader: what was received, as packets.
        hello_by: when `hello` has to have come; infinity if it need not [NEG-12].
        linger_until: when the rest of a connection that ends is not waited for any more.
    """

    def __init__(self, channel: Channel, terms: Terms, now: float) -> None:
        self.channel = channel
        self.unsent = bytearray()
        self.program = "a client that said no hello"
        self.welcome: Welcome | None = None
        self.ending: str | None = None
        self.is_held = False
        self.share = Share()
        self.is_known = False
        self.state = State.NEW
        self._terms = terms
        self.reader = PacketReader()
        self.input_ended = False
        self.hello_by = math.inf if terms.token is None else now + LIMITS["hello_seconds"]
        self._send_by = math.inf
        self.linger_until = math.inf

    @property
    def over(self) -> bool:
        """Whether nothing is left to send or to wait for: the socket can be closed."""
        is_through = self.state is State.CLOSING and not self.unsent and self.input_ended
        return self.state is State.CLOSED or is_through

    @property
    def deadline(self) -> float:
        """The moment at which to call `expire`; infinity if there is none."""
        ends = (self.hello_by, self.reader.deadline, self._send_by, self.linger_until)
        return min(*ends, self.share.rests_until)

    @property
    def is_open(self) -> bool:
        """Whether it is served."""
        return self.state in OPEN

    def turn(self, turn: Turn) -> None:
        """Goes to the next state."""
        self.state = TURNS.get((self.state, turn), self.state)

    def has(self, capability: str) -> bool:
        """Whether both sides declared the capability on this connection [NEG-7]."""
        return self.welcome is not None and capability in self.welcome.capabilities

    def receive(self, data: bytes, now: float) -> None:
        """Takes what a read returned, nothing meaning the end of the stream [CHN-16]."""
        if not data:
            self.input_ended = True
        elif self.is_open:
            self.reader.receive(data, now)

    def next_event(self, now: float) -> Event | None:
        """The next message or refusal in what was received; None when more is needed.

        A `hello` has been answered when it is returned.
        """
        if not (self.is_ready and self.is_open):
            return None
        try:
            payload = self.reader.next_packet(now)
        except FramingError as error:
            refusal = self.complain(Refusal(error.code, str(error)))
            self.end(f"{error.code}, after which nothing can be read [FRM-3]", now)
            return refusal
        if payload is not None:
            if len(payload) > LONG_BYTES:
                self.share.rest(now + REST_SECONDS * len(payload) / MAX_PAYLOAD_BYTES)
                self.measure(now)
            event = self.understand(payload, now)
            self.is_known = self.is_known or not isinstance(event, Refusal)
            return event
        if self.input_ended:
            where = ", in the middle of a packet [FRM-6]" if self.reader.incomplete else ""
            self.end(f"the client closed it{where}", now)
        return None

    @property
    def is_ready(self) -> bool:
        """Whether what it sent is looked at."""
        return not (self.is_held or self.share.is_resting or len(self.unsent) > FULL_BYTES)

    def measure(self, now: float) -> None:
        """Counts the time that a packet takes only while what comes is looked at [FRM-5]."""
        if self.is_ready and self.is_open:
            self.reader.go_on(now)
        else:
            self.reader.hold()

    def charge(self, worked: float, owing: int, now: float) -> None:
        """Takes it that the thread worked so long for it: see `Share.charge`."""
        self.share.charge(worked, owing, now)
        self.measure(now)

    def hold(self) -> None:
        """Has no more events until it is told to `go_on`."""
        self.is_held = True
        self.reader.hold()

    def go_on(self, now: float) -> None:
        """Has events again, of what was received meanwhile."""
        self.is_held = False
        self.measure(now)

    def send(self, message: ServerMessage) -> None:
        """Queues a message."""
        self.unsent += encode(message, typed_replies=self.welcome is not None)

    def sent(self, count: int, now: float) -> None:
        """Notes that TCP took `count` bytes of `unsent` and would have to wait for the rest."""
        del self.unsent[:count]
        if not self.unsent:
            self._send_by = math.inf
            if not self.is_open:
                self.linger_until = min(self.linger_until, now + LINGER_SECONDS)
        elif len(self.unsent) > LIMITS["max_unsent_bytes"]:
            self.abort(f"it left {len(self.unsent)} bytes unread [LIM-2]")
        elif count or self._send_by == math.inf:
            self._send_by = now + LIMITS["stalled_reader_seconds"]
        self.measure(now)

    def end(self, reason: str, now: float) -> None:
        """Takes no more events; what is unsent still goes out."""
        if self.is_open:
            self.turn(Turn.END)
            self.ending = reason
            self.hello_by = math.inf
            self.reader.hold()
            if not self.unsent:
                self.linger_until = now + LINGER_SECONDS

    def complain(self, refusal: Refusal) -> Refusal:
        """Sends it as an `error`, where the client has said hello [NEG-22]; returns it."""
        if self.welcome is not None:
            self.send(error_message(*refusal))
        return refusal

    def expire(self, now: float) -> None:
        """Does what is due once `deadline` has passed."""
        if now >= self.linger_until:
            self.turn(Turn.LOSS)
        elif now >= self._send_by:
            self.abort(f"it read nothing for {LIMITS['stalled_reader_seconds']} s [LIM-2]")
        elif now >= self.reader.deadline:
            other = seems(self.reader.decoder.unfinished)
            self.end(
                f"a packet was not complete after {COMPLETION_SECONDS:g} s [FRM-5]{other}", now
            )
        elif now >= self.hello_by:
            self.end(f"no hello after {LIMITS['hello_seconds']} s [NEG-12]", now)
        else:
            self.share.expire(now)
            self.measure(now)

    def abort(self, reason: str) -> None:
        """Ends without waiting for what is unsent."""
        self.turn(Turn.LOSS)
        self.ending = self.ending or reason

    @property
    def is_heard(self) -> bool:
        """Whether anything but `hello` counts: without one, on the message channel, to all."""
        return self.state in (State.SPEAKS_1_1, State.AGREED_ON_1_0) or (
            self.channel == "msg" and self._terms.token is None
        )

    def understand(self, payload: bytes, now: float) -> Event:
        """What a packet means; a `hello` is answered."""
        try:
            decode = read_short_message if len(payload) <= SHORT_BYTES else read_message
            message = decode(payload, self.channel, self.welcome and self.welcome.capabilities)
            if isinstance(message, Hello) and self.state is not State.AGREED_ON_1_0:
                return self.greet(message, now)
        except ProtocolError as error:
            return self.refuse_packet(error, now)
        if isinstance(message, Hello):
            return Refusal("unknown_type", "hello is none of 1.0, which was agreed upon [NEG-33]")
        if self.is_heard:
            return message
        return Refusal("unauthorized", "no hello came before it [CHN-7, NEG-19]")

    def greet(self, hello: Hello, now: float) -> Event:
        """Answers `hello`, and settles the version [NEG-6, NEG-33]."""
        if self.welcome is not None:
            raise ProtocolError("invalid_message", "hello was said before", requirement="NEG-3")
        self.program = " ".join(hello.client)
        answer = answer_hello(
            hello,
            versions=VERSIONS,
            capabilities=self._terms.capabilities[self.channel],
            server=self._terms.server,
            token=self._terms.token,
        )
        self.send(answer)
        if isinstance(answer, ErrorMessage):
            self.end(f"{answer.code} [NEG-25]", now)
            return Refusal(answer.code, answer.message)
        self.hello_by = math.inf
        if answer.version == "1.0":
            self.turn(Turn.WELCOME_TO_1_0)  # NEG-33
        else:
            self.turn(Turn.WELCOME_TO_1_1)
            self.welcome = answer
        return hello

    def refuse_packet(self, error: ProtocolError, now: float) -> Refusal:
        """An `error` after hello [NEG-29]; before, silence, or an end for who awaits a reply."""
        kind, request = type_and_id(error.received)
        if self.welcome is None and self.is_heard and kind in REQUESTS:
            self.end("a client that awaits the reply to a bad request learns so [REQ-9]", now)
        if self.state is State.NEW and kind == "hello":
            self.send(error_message(error.code, str(error), error.pointer))
            self.end("a hello that breaks NEG-2 [NEG-35]", now)
        is_request = self.channel == "msg" and kind in REQUESTS_1_1
        answered = request if is_request else None
        return self.complain(Refusal(error.code, str(error), error.pointer, answered))


def error_message(
    code: str, text: str, pointer: str | None = None, request: int | None = None
) -> ErrorMessage:
    """An `error` whose text is not too long."""
    return ErrorMessage(code, text[: LIMITS["max_message_chars"]], id=request, pointer=pointer)


def read_message(payload: bytes, channel: Channel, agreed: tuple[str, ...] | None) -> ClientMessage:
    """The message of a payload; ProtocolError if it breaks a rule."""
    return decode_from_client(payload, channel, said_hello=agreed is not None, agreed=agreed)


read_short_message = lru_cache(maxsize=64)(read_message)


def type_and_id(message: Mapping[str, Any]) -> tuple[object, int | None]:
    """What can be said of a message that is refused: its type, and its `id` if that is one."""
    request = message.get("id", -1)
    is_number = type(request) in (int, float)
    is_id = is_number and 0 <= request <= LIMITS["max_safe_integer"] and request % 1 == 0
    return message.get("type"), int(request) if is_id else None
