"""Allowed variations: clients that are unusual, and conform. The harness must pass them."""

import itertools
import os

import numpy as np
from splatbus_client import steering
from splatbus_client.events import Ignored, MustClose, Refused, ServerError
from splatbus_client.host_memory import CannotOpenError
from splatbus_client.message_protocol import MessageProtocol
from splatbus_schemas import LIMITS
from splatbus_wire.errors import ProtocolError
from splatbus_wire.settings import TOKEN_VARIABLE

from tests.zoo.faults.respelling import (
    add_members,
    escape_letters,
    reverse_members,
    space_out,
    write_fractions,
)
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, viewer
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import variation
from tests.zoo.mutants.v1_0.chn.clients import speaks_1_0 as say_no_hello
from tests.zoo.mutants.v1_0.frm.clients import in_two_writes
from tests.zoo.mutants.v1_0.req.clients import asks_once
from tests.zoo.mutants.v1_1.img.clients import subscribes
from tests.zoo.mutants.v1_1.neg.clients import without
from tests.zoo.mutants.v1_1.neg.granted import asks_for_a_size_again, says


@variation()
def members_that_nobody_knows(patch):
    """Adds members of its own to every message."""
    add_members(patch)


@variation(warns=("POS-4",))
def members_in_reverse_order(patch):
    """Writes the members of every object in reverse."""
    reverse_members(patch)


@variation()
def white_space_everywhere(patch):
    """Writes JSON for people, with white space around it."""
    space_out(patch)


@variation()
def escapes_everywhere(patch):
    """Writes every letter in names and strings as an escape."""
    escape_letters(patch)


@variation()
def numbers_of_17_digits(patch):
    """Writes every fraction with 17 digits."""
    write_fractions(patch, b"%.17f")


@variation()
def numbers_with_exponents(patch):
    """Writes every fraction with an exponent."""
    write_fractions(patch, b"%.17E")


@variation(warns=("EVO-4",))
def timestamps_everywhere(patch):
    """Stamps every message, requests too, by a clock that stands still, and began long ago."""
    messages(patch, lambda message: message | {"timestamp": 1_700_000_000.25})


@variation()
def no_timestamps(patch):
    """Stamps nothing."""
    messages(patch, without("timestamp"))


@variation(warns=("FRM-7",))
def header_and_payload_apart(patch):
    """Sends the header, and a moment later the payload."""
    in_two_writes(patch)


@variation()
def closes_on_what_is_broken(patch):
    """Closes the connection on broken text and broken init packets, instead of ignoring them."""

    def strict(original, *arguments):
        try:
            return original(*arguments)
        except ProtocolError as problem:
            of_1_1 = b'"type"' in arguments[0] and problem.code == "invalid_message"
            if of_1_1 or problem.code == "unknown_type":
                raise
            raise MustCloseError(str(problem)) from None

    def closing(original, *arguments):
        try:
            yield from original(*arguments)
        except MustCloseError as problem:
            yield MustClose(str(problem))

    client.READS_ON_IPC.wrap(patch, strict)
    client.READS_MESSAGE.wrap(patch, strict)
    client.TAKES_PAYLOAD_ON_IPC.wrap(patch, closing)
    client.TAKES_PAYLOAD.wrap(patch, closing)


class MustCloseError(Exception):
    """What was received breaks a rule."""


@variation()
def comes_back_at_an_even_pace(patch):
    """Connects again after 110 milliseconds, each time, whatever it came for."""
    client.DELAYS_OF_ATTEMPTS.replace(patch, lambda: itertools.repeat(0.11))


@variation(at=client.TAKES_FRAME)
def closes_on_frames_of_unknown_memory(original, self, frame):
    """Closes the connection on a frame of memory that is not there, instead of ignoring it."""
    for event in original(self, frame):
        yield MustClose(event.reason) if isinstance(event, Ignored) else event


@variation()
def never_subscribes(patch):
    """Does not declare `subscribe`."""
    client.CAPABILITIES_ON_IPC.replace(patch, ("host_shm", "frames", "reinit"))


@variation()
def subscribes_to_depth_alone(patch):
    """Subscribes to depth as soon as it may."""
    subscribes(patch, "depth")


@variation()
def no_reinit(patch):
    """Does not declare `reinit`."""
    client.CAPABILITIES_ON_IPC.replace(patch, ("host_shm", "frames"))


@variation()
def no_frames(patch):
    """Does not declare `frames`: opens the memory, and leaves it alone."""
    client.CAPABILITIES_ON_IPC.replace(patch, ("host_shm",))


@variation()
def cuda_memory_alone(patch):
    """Can open CUDA memory, and none of the host."""
    client.CAPABILITIES_ON_IPC.replace(patch, ("cuda_ipc", "frames", "reinit"))

    def images(_, packet):
        raise CannotOpenError("this client has CUDA memory alone")

    client.OPENS_MEMORY.wrap(patch, images)


@variation()
def capabilities_of_tomorrow(patch):
    """Declares capabilities of its vendor's, which no version knows."""

    def more(hello):
        own = ("x-example-hologram", "x-0_-_")
        return hello | {"capabilities": [*hello["capabilities"], *own]}

    messages(patch, of_type("hello", more))


@variation()
def versions_of_tomorrow(patch):
    """Lists versions that nobody knows before 1.1."""
    messages(patch, of_type("hello", lambda hello: hello | {"versions": ["7.12", "1.1"]}))


@variation()
def token(patch):
    """Says a token, though nobody asks for one."""
    patch.setitem(os.environ, TOKEN_VARIABLE, "a token of the longest kind".ljust(256, "."))


@variation()
def comes_back_slowly(patch):
    """Connects again after more than half a second."""
    client.DELAYS_OF_ATTEMPTS.replace(patch, lambda: itertools.repeat(0.6))


@variation()
def declares_nothing_on_the_message_channel(patch):
    """Declares no capability of the message channel."""
    Seam(steering, "CAPABILITIES").replace(patch, ())


@variation()
def says_all_of_1_1(patch):
    """Sends every message of 1.1 on each connection of the message channel."""
    says(patch)


@variation()
def insists_on_another_size(patch):
    """Asks for images of another size until it has them, as often as it may."""
    asks_for_a_size_again(patch)


@variation(axes="opencv")
def flushes_subnormal_numbers(patch):
    """Takes numbers that are too small for normal ones of single precision for 0."""

    def flushed(numbers):
        return np.where(np.abs(numbers) < LIMITS["min_normal_single"], np.float32(0), numbers)

    def composed(original, color, *rest):
        return flushed(original(flushed(color), *rest))

    viewer.COMPOSES.wrap(patch, composed)


@variation(warns=("NEG-39",))
def says_nothing_but_hello(patch):
    """Sends neither poses nor requests."""
    client.ASKS.replace(patch, lambda self, request: -1)
    Seam(MessageProtocol, "tell").replace(patch, lambda self, message: None)


@variation()
def speaks_1_0(patch):
    """Speaks 1.0 alone."""
    say_no_hello(patch)


@variation()
def requests_without_id(patch):
    """Does not number its requests."""
    messages(patch, without("id"))
    client.READS_MESSAGE.wrap(
        patch,
        lambda original, payload, request: original(payload, request and request._replace(id=None)),
    )


@variation()
def the_same_id_in_every_request(patch):
    """Gives each request the id of the one before, which has been answered."""

    def decode(original, payload, request):
        numbered = request is not None and request.id is not None
        message = original(payload, request._replace(id=7) if numbered else request)
        answers = numbered and getattr(message, "id", None) == 7
        return message._replace(id=request.id) if answers else message

    messages(patch, lambda message: message | {"id": 7} if "id" in message else message)
    client.READS_MESSAGE.wrap(patch, decode)


@variation(warns=("NEG-39",))
def asks_once_a_process(patch):
    """Makes requests on its first connection only."""
    asks_once(patch)


@variation(at=client.TAKES_BROKEN_PACKET)
def closes_on_a_frame_that_it_cannot_use(original, self, payload, problem):
    """Closes the connection, and gives the slot back so, when a frame is malformed."""
    if b'"frame"' in payload:
        yield MustClose(problem)
    else:
        yield from original(self, payload, problem)


@variation()
def last_camera(patch):
    """Asks for camera −1, which is the last."""
    messages(patch, of_type("get_camera_pose", lambda request: request | {"cam_idx": -1}))


@variation()
def images_alone(patch):
    """Has no use for the message channel."""
    _one_channel(patch, "IPC")


@variation()
def steers_alone(patch):
    """Has no use for the IPC channel."""
    _one_channel(patch, "message")


def _one_channel(patch, name):
    def connect(original, self, now):
        if self.name == name:
            original(self, now)
        else:
            self.due = now + 60

    client.CONNECTS.wrap(patch, connect)


@variation(warns=("CHN-20",), at=client.LOSES_CONNECTION)
def ends_with_its_server(original, self, reason, now):
    """Ends in an orderly way as soon as a connection is lost."""
    original(self, reason, now)
    if self.status.connections:
        os._exit(0)


@variation()
def closes_after_every_error(patch):
    """Closes the connection after any `error`, and on a `welcome` that comes too late."""

    def closing(original, *arguments):
        for event in original(*arguments):
            yield event
            late = isinstance(event, Ignored) and "NEG-40" in event.reason
            if late or isinstance(event, (ServerError, Refused)):
                yield MustClose("it had enough")

    client.TAKES_PAYLOAD_ON_IPC.wrap(patch, closing)
    client.TAKES_PAYLOAD.wrap(patch, closing)
