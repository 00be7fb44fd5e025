"""The message channel, sans I/O: bytes in, events out, bytes to send (1.0 chapter 6, 1.1 2).

Requests go out one at a time. Replies of 1.0 carry no id, so a reply that cannot be understood
could otherwise make every later one answer the wrong request [REQ-11].
"""

from collections import deque
from collections.abc import Iterator
from itertools import count

from splatbus_schemas import LIMITS
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.messages import (
    CameraPose,
    CameraReply,
    ErrorMessage,
    GetViewportSize,
    Hello,
    PointCloudPose,
    Pose,
    Request,
    ViewportSize,
    Welcome,
    decode_from_server_message,
    encode,
)
from splatbus_wire.rotations import check_quaternion

from splatbus_client.events import (
    Ignored,
    MessageEvent,
    MustClose,
    Negotiated,
    Refused,
    Replied,
    ServerError,
)
from splatbus_client.incoming import Incoming

# The limits bind as the server sees them, and its clock and scheduler are not ours.
REPLY_SECONDS: float = 0.9 * LIMITS["reply_seconds"]
ASK_AGAIN_SECONDS: float = 1.25 * LIMITS["ask_again_min_seconds"]


class MessageProtocol:
    """One connection on the message channel, from `hello` to its end.

    Times are seconds of any one clock that never goes back.

    Args:
        hello: sent first [NEG-1]; a request for the viewport's size follows it, because its reply
            tells a server of 1.0, which ignores `hello`, from a later one [NEG-13].
    """

    def __init__(self, hello: Hello) -> None:
        self.version: str | None = None
        self._hello = hello
        self._incoming = Incoming()
        self._out = bytearray(encode(hello))
        self._tickets: Iterator[int] = count()
        self._queue: deque[tuple[int, Request]] = deque()
        self._asked: tuple[int, Request] | None = None  # as it was sent, with its id if it had one
        self._reply_due = 0.0
        self._ask_size_from = 0.0
        self._newest: dict[type, bytes] = {}
        self.ask(GetViewportSize())

    def ask(self, request: Request) -> int:
        """Queue a request and return the ticket of its reply.

        A request that equals one which is still unanswered shares that one's ticket.
        """
        asked = [] if self._asked is None else [self._asked]
        for ticket, unanswered in [*asked, *self._queue]:
            if unanswered._replace(id=None) == request:
                return ticket
        ticket = next(self._tickets)
        self._queue.append((ticket, request))
        return ticket

    def pose(self, message: CameraPose | PointCloudPose) -> None:
        """Send a pose with the next data; it replaces one of its kind that is still unsent [POS-7].

        Raises:
            ProtocolError: the pose breaks POS-2 or POS-3.
        """
        packet = encode(message._replace(pose=_checked(message.pose)))
        self._newest.pop(type(message), None)  # so that timestamps leave in order [POS-9]
        self._newest[type(message)] = packet

    def data_to_send(self, now: float) -> bytes:
        """Return what is to be sent next; call it again when that has been sent whole."""
        self._send_request(now)
        self._out += b"".join(self._newest.values())
        self._newest.clear()
        data = bytes(self._out)
        self._out.clear()
        return data

    def deadline(self) -> float | None:
        """Return when `expire` or `data_to_send` is to be called next, if nothing comes before."""
        times = [self._incoming.deadline]
        if self._asked is not None:
            times.append(self._reply_due)
        elif self._queue:
            times.append(self._ask_size_from)
        return min((time for time in times if time is not None), default=None)

    def expire(self, now: float) -> list[MessageEvent]:
        """Return what follows from the time alone [FRM-5, CHN-15]."""
        if self._asked is not None and now >= self._reply_due:
            return [
                MustClose(
                    f"no reply to {_name(self._asked[1])} within {REPLY_SECONDS:g} s [CHN-15]"
                )
            ]
        if self._incoming.deadline is not None and now >= self._incoming.deadline:
            return [MustClose("a packet was begun and not completed in time [FRM-5]")]
        return []

    def receive(self, data: bytes, now: float) -> Iterator[MessageEvent]:
        """Yield what the bytes mean; `MustClose`, if any, is the last.

        Act on each event before taking the next: what a packet means can depend on it.
        """
        try:
            for payload in self._incoming.receive(data, now):
                for event in self._on_payload(payload, now):
                    yield event
                    if isinstance(event, MustClose):
                        return
        except FramingError as error:
            yield MustClose(str(error))

    def _send_request(self, now: float) -> None:
        """Send the first request that may be sent, if none is unanswered."""
        too_early = GetViewportSize if now < self._ask_size_from else ()
        ready = next((item for item in self._queue if not isinstance(item[1], too_early)), None)
        if self._asked is not None or ready is None:
            return
        self._queue.remove(ready)
        ticket, request = ready
        if self.version == "1.1":
            # An error that answers the request is told by its id from one that reports a pose.
            request = request._replace(id=ticket)
        self._asked = (ticket, request)
        self._reply_due = now + REPLY_SECONDS
        self._out += encode(request)

    def _on_payload(self, payload: bytes, now: float) -> Iterator[MessageEvent]:
        request = None if self._asked is None else self._asked[1]
        try:
            message = decode_from_server_message(payload, request)
        except ProtocolError as problem:
            # Whatever it was, the request that waits is still unanswered: if nothing else comes,
            # its time runs out and the connection with it, rather than its order [REQ-13].
            yield Ignored(str(problem))
            return
        match message:
            case Welcome():
                yield from self._on_welcome(message)
            case ErrorMessage():
                yield from self._on_error(message)
            case ViewportSize() | CameraReply():
                yield from self._on_reply(message, now)

    def _on_welcome(self, welcome: Welcome) -> Iterator[MessageEvent]:
        if welcome.version not in self._hello.versions:
            yield MustClose(f"welcome names version {welcome.version}, not offered [NEG-16]")
        elif self.version is not None:
            yield Ignored("welcome came when the version was settled [NEG-13]")
        else:
            self.version = welcome.version
            yield Negotiated(welcome.version, welcome.server, frozenset(welcome.capabilities))

    def _on_reply(self, reply: ViewportSize | CameraReply, now: float) -> Iterator[MessageEvent]:
        assert self._asked is not None  # or it would not have been decoded as a reply
        if self.version is None:
            self.version = "1.0"
            yield Negotiated("1.0", None, frozenset())
        ticket, self._asked = self._asked[0], None
        if isinstance(reply, ViewportSize) and reply.width * reply.height == 0:
            self._ask_size_from = now + ASK_AGAIN_SECONDS  # [REQ-12]
        yield Replied(ticket, reply)

    def _on_error(self, error: ErrorMessage) -> Iterator[MessageEvent]:
        # An error without id, while the request that went out before `welcome` waits, may mean
        # that one or a pose. Taking it for the former is harmless: later replies carry ids.
        if self._asked is None or error.id != self._asked[1].id:
            yield ServerError(error)
            return
        ticket, self._asked = self._asked[0], None
        yield Refused(ticket, error)


def _checked(pose: Pose) -> Pose:
    """Return the pose in plain floats, whatever numbers it came in [POS-2, POS-3, ACC-1]."""
    x, y, z = map(float, pose.position)
    i, j, k, w = map(float, pose.rotation)
    if not all(abs(coordinate) <= LIMITS["max_position"] for coordinate in (x, y, z)):
        raise ProtocolError(
            "invalid_number",
            f"the position {(x, y, z)} is not within single precision",
            requirement="POS-2",
            pointer="/position",
        )
    check_quaternion((i, j, k, w), pointer="/rotation")
    return Pose((x, y, z), (i, j, k, w))


def _name(request: Request) -> str:
    return "get_viewport_size" if isinstance(request, GetViewportSize) else "get_camera_pose"
