"""Mutants that keep what they should forget, or forget what they should keep, once something was
before: another size, another error, a former request or connection.
"""

from collections import Counter
from typing import Any

from splatbus_server.connection import Connection, Refusal
from splatbus_server.control import Poses
from splatbus_server.viewport import Change
from splatbus_wire.messages import GetViewportSize, ViewportSize

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server, wire
from tests.zoo.mutant import mutant


@mutant("NEG-6", check="check_answers_a_hello_that_comes_late", code="no-welcome")
def server_greets_only_who_greets_first(patch):
    """Ignores a hello that is not the first message of its connection."""

    def understand(original, self, payload, now):
        if self in spoken and self.welcome is None and b'"hello"' in payload:
            return Refusal("unknown_type", "too late")
        spoken.add(self)
        return original(self, payload, now)

    spoken: set[Connection] = set()
    server.UNDERSTANDS.wrap(patch, understand)


@mutant("NEG-26", check="check_goes_on_after_an_error", code="no-longer-served")
def server_has_enough_of_errors(patch):
    """Closes a connection after a hundred errors."""

    def complain(original, self, refusal):
        original(self, refusal)
        counted[self] += 1
        if counted[self] == 100:
            self.end("enough", 0.0)
        return refusal

    counted: Counter[Connection] = Counter()
    server.COMPLAINS.wrap(patch, complain)


@mutant("NEG-28", check="check_answers_repeat_an_id_that_was_used", code="wrong-id")
def server_gives_an_id_back_once(patch):
    """Leaves the id out of a reply whose id the reply before it had."""

    def send(original, self, message):
        id = getattr(message, "id", None)
        if id is not None and newest.get(self) == id:
            message = message._replace(id=None)
        newest[self] = id
        original(self, message)

    newest: dict[Connection, int | None] = {}
    server.SENDS.wrap(patch, send)


@mutant(
    "REQ-7",
    check="check_answers_what_came_before_a_broken_request",
    code="wrong-count",
    at=server.REFUSES_PACKET,
)
def server_discards_replies_when_it_closes(original, self, *arguments):
    """Throws away what is unsent when a broken request has it close the connection."""
    refusal = original(self, *arguments)
    if not self.is_open:
        self.unsent.clear()
    return refusal


@mutant("NEG-29", check="check_answers_what_follows_another_size_after_it", code="out-of-order")
def server_lets_pings_pass_another_size(patch):
    """Answers a ping behind a set_viewport whose reply is held back, if it is the next."""
    _handles_while_held(patch, b'"ping"')


@mutant(
    "NEG-29",
    check="check_answers_what_follows_another_size_after_it",
    code="out-of-order",
    at=server.BEGINS_OTHER_SIZE,
)
def server_forgets_sizes_behind_another(original, self, asker, request):
    """Drops a set_viewport that came behind one whose reply is held back."""
    original(self, asker, request)
    waiting = asker.reader.decoder.payloads
    if asker.is_held:
        kept = [each for each in waiting if b"set_viewport" not in each]
        waiting.clear()
        waiting.extend(kept)


@mutant(
    "CHN-16",
    check="check_answers_behind_another_size_before_the_end",
    code="wrong-count",
    at=server.GOES_ON,
)
def server_keeps_few_requests_behind_another_size(original, self, now):
    """Keeps thirty of the requests that came behind one whose reply is held back."""
    original(self, now)
    waiting = self.reader.decoder.payloads
    while len(waiting) > 30:
        waiting.pop()


@mutant("REQ-4", check="check_tells_everybody_of_the_newest_size", code="wrong-size")
def server_tells_each_the_size_of_the_first_time(patch):
    """Tells a connection the size that images had when it first asked."""

    def answer(original, self, connection, request, now):
        if not isinstance(request, GetViewportSize):
            return original(self, connection, request, now)
        memory = self.exchange.memory
        size = sizes.setdefault(connection, (memory.width, memory.height))
        connection.send(ViewportSize(*size, request.id))
        return None

    sizes: dict[Any, tuple[int, int]] = {}
    server.ANSWERS_REQUEST.wrap(patch, answer)


@mutant("VPT-6", check="check_announces_no_other_memory_unasked", code="unwanted-init-packet")
def server_makes_memory_anew_of_a_later_size(patch):
    """Takes only the size that images had at first for the one that they have."""

    def begin(original, self, asker, request):
        memory = self.exchange.memory
        first.append((memory.width, memory.height))
        if (memory.width, memory.height) != request[:2] or request[:2] == first[0]:
            original(self, asker, request)
        else:
            self.change = Change(asker, request, memory)
            self.chores.append(self.change.allocate)
            asker.hold()

    first: list[tuple[int, int]] = []
    server.BEGINS_OTHER_SIZE.wrap(patch, begin)


@mutant("CAM-2", check="check_a_tag_that_was_used_comes_again", code="another-tag")
def server_sends_a_tag_once(patch):
    """Takes a tag that it has sent on a connection for one that was answered."""

    def frame(original, self, image):
        told = original(self, image)
        tag = told.camera.tag
        if tag is not None and newest.get(id(self)) == tag:
            return told._replace(camera=told.camera._replace(tag=None))
        newest[id(self)] = tag or newest.get(id(self), "")
        return told

    newest: dict[int, str] = {}
    server.TELLS_OF_IMAGE.wrap(patch, frame)


@mutant(
    "CTL-3",
    check="check_lens_and_time_end_with_their_client",
    code="intrinsics-kept",
    at=server.PASSES_CONTROL_ON,
)
def server_keeps_the_lens_of_who_was_lost(original, self, connection):
    """Leaves intrinsics and time in force of a connection that did not end its stream."""
    former, had = self.poses, self.holder is connection
    given = original(self, connection)
    if had and not connection.input_ended:
        self.poses = self.poses._replace(intrinsics=former.intrinsics, time=former.time)
    return given


@mutant("POS-7", check="check_poses_of_any_time_are_poses", code="pose-not-shown")
def server_passes_over_older_poses(patch):
    """Ignores a pose whose timestamp is less than the greatest that anybody has sent."""

    def move(original, self, connection, message):
        moment = getattr(message, "timestamp", None)
        if moment is not None:
            newest.append(moment)
            if moment < max(newest):
                return None
        return original(self, connection, message)

    newest: list[float] = []
    server.TAKES_POSE.wrap(patch, move)


@mutant("OBJ-5", check="check_a_scale_that_is_absent_is_1", code="another-placement")
def server_keeps_a_scale_that_is_not_said(patch):
    """Leaves an object its scale when a pose of it has none."""

    def parse(original, message):
        pose = original(message)
        return pose if "scale" in message.value else pose._replace(scale=0.0)

    def put(original, self, placement):
        if not placement.scale:
            placement = placement._replace(scale=self.objects[placement.object].scale)
        moved: Poses = original(self, placement)
        return moved

    wire.READS_POSE_THE_SHORT_WAY.replace(patch, lambda payload: None)
    wire.POSE_OF_OBJECT.wrap(patch, parse)
    Seam(Poses, "placed").wrap(patch, put)


def _handles_while_held(patch, part):
    def next_event(original, self, now):
        waiting = self.reader.decoder.payloads
        passing = next((each for each in waiting if part in each), None)
        if self.is_held and passing is not None:
            waiting.remove(passing)
            return self.understand(passing, now)
        return original(self, now)

    server.NEXT_EVENT.wrap(patch, next_event)
