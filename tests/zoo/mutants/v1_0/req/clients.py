"""Mutants that break REQ: requests and replies."""

from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import GetCameraPose, GetViewportSize, ViewportSize

from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import crash, messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.clients import without


@mutant("REQ-1", code="wrong-value")
def types_in_camel_case(patch):
    """Writes the type of a request in camel case."""
    messages(patch, of_type("get_viewport_size", lambda it: it | {"type": "getViewportSize"}))


@mutant("REQ-2", code="not-an-integer", through="NEG-5")
def camera_by_name(patch):
    """Asks for a camera by its name."""
    messages(patch, of_type("get_camera_pose", lambda request: request | {"cam_idx": "front"}))


@mutant("REQ-2", code="not-an-integer", through="NEG-5")
def camera_index_with_a_fraction(patch):
    """Asks for camera 0.5."""
    messages(patch, of_type("get_camera_pose", lambda request: request | {"cam_idx": 0.5}))


@mutant("REQ-2", code="missing-member", through="NEG-5")
def no_camera_index(patch):
    """Asks for a camera without saying which."""
    messages(patch, of_type("get_camera_pose", without("cam_idx")))


@mutant(
    "REQ-11",
    check="check_matches_replies_by_their_order",
    code="reply-not-taken",
    axes="opencv",
    at=client.READS_MESSAGE,
)
def understands_no_camera(original, payload, request):
    """Takes every reply to `get_camera_pose` for a broken one, and waits on."""
    if isinstance(request, GetCameraPose) and b'"position"' in payload:
        raise ProtocolError("invalid_message", "no camera", requirement="REQ-5")
    return original(payload, request)


@mutant("REQ-12", check="check_asks_again_after_a_while", code="too-soon")
def asks_again_at_once(patch):
    """Asks for the size again as soon as it is told that there is none."""
    _asks_again(patch, 0.0)


@mutant("REQ-12", code="too-soon", through="REQ-12")
def asks_again_too_soon(patch):
    """Asks for the size again after 20 milliseconds."""
    _asks_again(patch, 0.02)


def _asks_again(patch, seconds):
    def on_reply(original, self, reply, now):
        yield from original(self, reply, now)
        if isinstance(reply, ViewportSize) and not reply.width:
            self.ask(GetViewportSize())

    client.PAUSE_TO_ASK_AGAIN.replace(patch, seconds)
    client.TAKES_REPLY.wrap(patch, on_reply)


@mutant("REQ-13", check="check_survives_bad_replies", code="dies")
def crashes_on_a_reply_without_members(patch):
    """Crashes on a reply that lacks the member that it looks for."""
    _on_a_bad_reply(patch, lambda problem: crash() if "is missing" in str(problem) else None)


@mutant("REQ-13", check="check_survives_bad_replies", code="exits")
def exits_on_a_size_that_is_no_array(patch):
    """Does not handle the error of a reply whose size is a string, and exits."""

    def fail(problem):
        if "an array" in str(problem):
            raise TypeError("no array")

    _on_a_bad_reply(patch, fail)


@mutant("REQ-13", check="check_survives_bad_replies", code="dies")
def crashes_on_a_size_with_a_fraction(patch):
    """Crashes on a size that is written with a fraction of zero."""
    _crashes(patch, lambda size: b".0," in size and b"." in size)


@mutant("REQ-13", check="check_survives_bad_replies", code="dies")
def crashes_on_a_size_of_null(patch):
    """Crashes on a size that is null."""
    _crashes(patch, lambda size: b"null" in size)


def _crashes(patch, at):
    def on_payload(original, self, payload, now):
        _, found, size = payload.partition(b'"viewport_size":')
        if found and at(size):
            crash()
        return original(self, payload, now)

    client.TAKES_PAYLOAD.wrap(patch, on_payload)


@mutant("JSN-6", check="check_takes_any_spelling", code="dies")
def asks_once_and_crashes_on_white_space(patch):
    """Asks on its first connection only, and crashes on a reply that begins with white space."""
    asks_once(patch)

    def on_payload(original, self, payload, now):
        if payload[:1] != b"{" and self.asked is not None:
            crash()
        return original(self, payload, now)

    client.TAKES_PAYLOAD.wrap(patch, on_payload)


def asks_once(patch):
    """Make no request on a connection after the first."""
    first: list[MessageProtocol] = []

    def ask(original, self, request):
        first.append(self)
        return int(original(self, request)) if self is first[0] else -1

    client.ASKS.wrap(patch, ask)


def _on_a_bad_reply(patch, react):
    def decode(original, payload, request):
        try:
            return original(payload, request)
        except ProtocolError as problem:
            react(problem)
            raise

    client.READS_MESSAGE.wrap(patch, decode)


@mutant("REQ-14", code="unknown-type")
def sends_a_type_of_its_own(patch):
    """Sends a `nudge` of its own after each request."""
    nudge = b'{"type":"nudge"}'

    def data_to_send(original, self, now):
        data: bytes = original(self, now)
        return data + len(nudge).to_bytes(4, "little") + nudge if b'"get_' in data else data

    client.SENDS_MESSAGES.wrap(patch, data_to_send)
