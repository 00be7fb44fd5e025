"""Mutants that break REQ: their answers are wrong, too many, too few or too late."""

import itertools
from typing import Any

from splatbus_server.connection import Refusal
from splatbus_wire.messages import (
    GetCameraPose,
    GetScene,
    GetViewportSize,
    SetViewport,
    ViewportSize,
)
from splatbus_wire.poses import Pose

from tests.zoo.faults.seams import renderer, server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.jsn.servers import decodes_as_after_hello

CAMERAS = tuple(Pose((float(n), 0.5, -4.0), (0.0, 0.6, 0.0, 0.8)) for n in range(3))


@mutant("REQ-3", code="out-of-range")
def server_tells_a_size_with_fractions(patch):
    """Writes the size as fractions."""
    _size(patch, lambda size: [float(part) for part in size])


@mutant("REQ-4", code="wrong-size", through="CHN-12")
def server_tells_another_size(patch):
    """Tells twice the size of its images."""
    _size(patch, lambda size: [2 * part for part in size])


@mutant("REQ-5", code="missing-member", through="REQ-7")
def server_tells_no_rotation(patch):
    """Leaves the rotation out of its replies."""
    messages(patch, lambda it: {k: v for k, v in it.items() if k != "rotation"})


@mutant("REQ-6", check="check_camera_index_is_taken_modulo", code="cameras-alike")
def server_stops_at_its_last_camera(patch):
    """Tells the last camera for every index beyond."""
    _cameras(patch, lambda index: min(max(index, 0), 2))


@mutant("REQ-6", check="check_camera_index_is_taken_modulo", code="another-camera")
def server_counts_from_the_wrong_end(patch):
    """Takes the magnitude of negative indices."""
    _cameras(patch, lambda index: abs(index) % 3)


@mutant("REQ-6", check="check_camera_index_is_taken_modulo", code="another-camera")
def server_reads_indices_as_32_bits(patch):
    """Keeps the lowest 32 bits of an index."""
    _cameras(patch, lambda index: ((index + 2**31) % 2**32 - 2**31) % 3)


@mutant("REQ-7", check="check_one_reply_each_in_order", code="other-replies")
def server_answers_in_its_own_order(patch):
    """Answers what arrives together with the sizes first."""
    _reorders(patch)


@mutant(
    "REQ-7", check="check_one_reply_each_in_order", code="other-replies", at=server.HANDLES_MESSAGE
)
def server_answers_a_hundred_at_most(original, self, connection, message, *rest):
    """Drops requests beyond a hundred that wait for an answer."""
    if len(connection.reader.decoder.payloads) < 100:
        return original(self, connection, message, *rest)
    return Refusal("busy", "too many")


@mutant("REQ-8", check="check_unknown_messages_are_ignored", code="closes", at=server.UNDERSTANDS)
def server_closes_on_unknown_types(original, self, payload, now):
    """Closes the message connection on a type that it does not know."""
    event = original(self, payload, now)
    if isinstance(event, Refusal) and event.code == "unknown_type":
        self.end("who knows that", now)
    return event


@mutant("REQ-8", check="check_unknown_messages_are_ignored", code="replies", at=server.UNDERSTANDS)
def server_answers_unknown_types(original, self, payload, now):
    """Answers what it does not know with the size of the image."""
    event = original(self, payload, now)
    unknown = isinstance(event, Refusal) and event.code == "unknown_type"
    return GetViewportSize(None, None) if unknown else event


@mutant("REQ-8", check="check_unknown_messages_are_ignored", code="replies")
def server_tells_its_scene_before_hello(patch):
    """Answers the `get_scene` of 1.1 where nobody said hello."""
    decodes_as_after_hello(patch, b'"get_scene"')


def stumbles_over_hello(patch):
    """Drop whoever says `hello`, and speak 1.0 with the others."""

    def answer(original, *arguments, **named):
        raise KeyError("hello")

    server.ANSWERS_HELLO.wrap(patch, answer)


@mutant("REQ-8", check="check_unknown_messages_are_ignored", code="closes")
def server_of_1_0_stumbles_over_hello(patch):
    """Speaks 1.0 alone, and drops whoever says hello on the message channel."""
    stumbles_over_hello(patch)


@mutant("REQ-9", check="check_broken_requests_have_no_reply", code="replies", at=server.UNDERSTANDS)
def server_answers_broken_requests(original, self, payload, now):
    """Takes camera 0 for an index that it cannot read."""
    state = self.state
    event = original(self, payload, now)
    if isinstance(event, Refusal) and b"get_camera_pose" in payload:
        self.state, self.ending = state, None
        self.linger_until = float("inf")
        return GetCameraPose(0, None, None)
    return event


@mutant("REQ-10", check="check_replies_do_not_wait_for_an_image", code="no-reply")
def server_answers_between_images(patch):
    """Answers when it has rendered the next image."""
    _answers_between_images(patch, GetViewportSize | GetCameraPose)


@mutant("REQ-10", check="check_replies_do_not_wait_for_an_image", code="no-reply")
def server_tells_of_its_scene_between_images(patch):
    """Tells of its scene when it has rendered the next image."""
    _answers_between_images(patch, GetScene)


@mutant(
    "NEG-29",
    check="check_answers_each_request_in_order",
    code="another-answer",
    at=server.HANDLES_MESSAGE,
)
def server_passes_over_the_size_that_it_has(original, self, connection, message, *rest):
    """Does not answer who asks for images of the size that they have."""
    memory = self.exchange.memory
    if isinstance(message, SetViewport) and message[:2] == (memory.width, memory.height):
        return None
    return original(self, connection, message, *rest)


@mutant("NEG-28", code="another-id", through="NEG-29")
def server_numbers_its_pongs(patch):
    """Answers pings with ids of its own."""
    ids = itertools.count(1)
    messages(patch, of_type("pong", lambda it: it | {"id": next(ids)} if "id" in it else it))


def _answers_between_images(patch, kinds):
    waiting: list[tuple[Any, ...]] = []

    def handle(original, self, connection, message, *rest):
        if isinstance(message, kinds):
            waiting.append((original, self, connection, message, *rest))
            return None
        return original(self, connection, message, *rest)

    def publish(original, self, *arguments):
        given = original(self, *arguments)
        while waiting:
            answer, *its = waiting.pop(0)
            answer(*its)
        return given

    server.HANDLES_MESSAGE.wrap(patch, handle)
    server.PUBLISHES.wrap(patch, publish)


def _size(patch, change):
    def changed(message):
        if "viewport_size" not in message:
            return message
        return message | {"viewport_size": change(message["viewport_size"])}

    messages(patch, changed)


def _cameras(patch, index):
    """Come with three cameras, and answer for the one that `index` chooses."""

    def handle(original, self, connection, message, *rest):
        if isinstance(message, GetCameraPose):
            message = message._replace(cam_idx=index(message.cam_idx))
        return original(self, connection, message, *rest)

    renderer.SERVES.wrap(
        patch, lambda original, *a, **named: original(*a, cameras=CAMERAS, **named)
    )
    server.HANDLES_MESSAGE.wrap(patch, handle)


def _reorders(patch):
    """Put the sizes before the cameras in what is about to be sent."""

    def send(original, self, message):
        before = bytes(self.unsent)
        if isinstance(message, ViewportSize) and before:
            self.unsent.clear()
            original(self, message)
            self.unsent += before
        else:
            original(self, message)

    server.SENDS.wrap(patch, send)


@mutant("REQ-9", check="check_broken_requests_have_no_reply", code="replies", at=server.UNDERSTANDS)
def server_answers_broken_requests_by_the_size(original, self, payload, now):
    """Answers a request for a camera whose index it cannot read by the size of the image."""
    state = self.state
    event = original(self, payload, now)
    if isinstance(event, Refusal) and b"get_camera_pose" in payload:
        self.state, self.ending = state, None
        self.linger_until = float("inf")
        return GetViewportSize(None, None)
    return event
