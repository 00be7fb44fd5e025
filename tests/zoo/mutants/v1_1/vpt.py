"""Mutants that break VPT, and what OPN says of memory that was replaced."""

from dataclasses import replace
from typing import Any

from splatbus_server.connection import Refusal
from splatbus_server.memory import Memory
from splatbus_server.viewport import Change, Viewport
from splatbus_wire.messages import GetViewportSize, OpenFailed, SetViewport, ViewportSize

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.cnv.servers import cameras

ANSWERS, TELLS = (
    "check_answers_with_the_size_or_an_error",
    "check_tells_every_reader_of_another_size",
)
KEEPS = "check_keeps_former_memory_until_it_is_closed"
LETS_GO = "check_closed_ends_the_lease"


def unhindered(patch, requirement, words):
    """Change the size of images although this should hinder it."""

    def hindrance(original, self, asker):
        refusal: Refusal | None = original(self, asker)
        stands = refusal is not None and requirement in refusal.reason and words in refusal.reason
        return None if stands else refusal

    server.HINDERS_OTHER_SIZE.wrap(patch, hindrance)


@mutant(
    "NEG-29",
    check="check_answers_what_follows_another_size_after_it",
    code="out-of-order",
)
def server_answers_while_it_makes_memory(patch):
    """Goes on answering requests while it has not yet answered a `set_viewport`."""
    server.HOLDS_REQUESTS.replace(patch, lambda self: None)


@mutant("VPT-2", check=ANSWERS, code="another-answer")
def server_rounds_sizes_up(patch):
    """Says that images have a width that four divides, whatever was asked for."""

    def size(width, height, id=None):
        return ViewportSize(-(-width // 4) * 4, height, id)

    server.SIZE_IN_REPLY.replace(patch, size)


@mutant("VPT-2", check=ANSWERS, code="wrong-size")
def server_tells_the_former_size(patch):
    """Agrees to a size, and leaves images as they are."""
    Seam(Viewport, "replace").wrap(patch, lambda original, self, change: None)


@mutant("VPT-2", code="wrong-size", through="VPT-2")
def server_swaps_sides(patch):
    """Answers with the height first."""
    server.SIZE_IN_REPLY.replace(patch, lambda w, h, id=None: ViewportSize(h, w, id))


@mutant("VPT-3", check="check_changes_nothing_for_who_cannot_follow", code="another-answer")
def server_cuts_off_who_cannot_follow(patch):
    """Changes the size, whoever reads."""
    unhindered(patch, "VPT-3", "")


@mutant("VPT-3", check="check_changes_nothing_for_who_cannot_follow", code="still-refused")
def server_remembers_who_could_not_follow(patch):
    """Changes no size any more once there was a reader without `reinit`."""
    remembered: list[Refusal] = []

    def hindrance(original, self, asker):
        refusal: Refusal | None = original(self, asker)
        if refusal is not None and refusal.code == "unsupported":
            remembered.append(refusal)
        return remembered[-1] if remembered else refusal

    server.HINDERS_OTHER_SIZE.wrap(patch, hindrance)


@mutant("VPT-2", check=ANSWERS, code="refused-yet-changed")
def server_tells_a_size_that_it_cannot_have(patch):
    """Tells the size that was asked for last, whether images have it or not."""
    asked: list[int] = []

    def answer(original, self, connection, *more):
        request = more[0]
        if isinstance(request, SetViewport):
            asked[:] = request.width, request.height
            if request.width == 1:
                return connection.complain(Refusal("unsupported", "too small", id=request.id))
        if isinstance(request, GetViewportSize) and asked:
            width, height = asked
            connection.send(ViewportSize(width, height, request.id))
            return None
        return original(self, connection, *more)

    server.ANSWERS_REQUEST.wrap(patch, answer)


@mutant("VPT-4", check="check_obeys_who_has_control", code="another-answer")
def server_changes_the_size_for_anyone(patch):
    """Changes the size, whoever asks."""
    unhindered(patch, "VPT-4", "steers")


@mutant("VPT-4", check="check_has_memory_twice_at_most", code="another-answer")
def server_has_memory_without_end(patch):
    """Changes the size, whoever still reads what was before."""
    unhindered(patch, "VPT-4", "memory")


@mutant("VPT-5", check=TELLS, code="no-init-packet", at=server.ANNOUNCES_MEMORY)
def server_tells_those_who_take_frames(original, self, connection, reader, *more):
    """Sends a further init packet to clients with `frames` alone."""
    if connection.has("frames") or not reader.told:
        original(self, connection, reader, *more)


@mutant(
    "VPT-6",
    check="check_announces_no_other_memory_unasked",
    code="unwanted-init-packet",
    at=server.BEGINS_OTHER_SIZE,
)
def server_makes_the_same_memory_again(original, self, asker, request):
    """Has new memory also for the size that its images have."""
    self.change = Change(asker, request, self.exchange.memory)
    self.chores.append(self.change.allocate)
    asker.hold()


@mutant("VPT-6", check="check_announces_no_other_memory_unasked", code="unwanted-init-packet")
def server_of_one_makes_the_same_memory_again(patch):
    """The same, and ends a message connection when another comes."""
    server_makes_the_same_memory_again.specimens[0].alter(patch)

    def accept(original, self, channel, listener):
        former = [peer for peer in self.peers if peer.connection.channel == channel == "msg"]
        original(self, channel, listener)
        for peer in former:
            self.drop(peer)

    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant("VPT-7", check="check_frees_former_memory", code="memory-left-behind")
def server_frees_nothing(patch):
    """Keeps former memory, and forgets it."""
    kept: list[Memory] = []
    server.FREES_MEMORY.replace(patch, lambda self: kept.append(self))


@mutant("VPT-8", check="check_closes_who_does_not_let_go", code="waits")
def server_waits_for_ever(patch):
    """Lets a client keep former memory."""
    server.ENDS_WHO_KEEPS.wrap(patch, lambda original, self, now: None)


@mutant("OPN-8", check=KEEPS, code="memory-gone")
def server_frees_memory_at_once(patch):
    """Frees former memory when there is other, whoever reads it."""
    forgets(patch, lambda reader, generation: True)


def forgets(patch, forgotten):
    """Forget that a reader has former memory, of some generations."""

    def free(original, self, now):
        for reader in self.readers.values():
            former = [number for number in reader.announced if number < reader.told]
            for number in former:
                if forgotten(reader, number):
                    del reader.announced[number]
        original(self, now)

    server.FREES_FORMER_MEMORY.wrap(patch, free)


@mutant("OPN-8", check=KEEPS, code="written-while-held", at=server.MAKES_SUCCESSOR)
def server_wipes_former_memory(original, self, *size):
    """Overwrites memory that was replaced, before it is freed."""
    made = original(self, *size)
    for slot in range(self.ring.slots):
        self.color(slot)[:] = 0.0
    return made


@mutant("OPN-8", check="check_keeps_former_memory_for_who_may_open_it", code="memory-gone")
def server_frees_what_nobody_has_opened(patch):
    """Frees former memory once those who said that they had opened it have closed it."""
    forgets(patch, lambda reader, generation: generation not in reader.opened)


@mutant("OPN-14", check=LETS_GO, code="no-frame", at=server.HEARS_OF_MEMORY)
def server_waits_for_the_release(original, self, connection, message):
    """Takes a frame for held until it is released, whatever becomes of its memory."""
    reader = self.readers.get(connection)
    lease = reader.lease if reader is not None else None
    refusal = original(self, connection, message)
    if reader is not None:
        reader.lease = lease
    return refusal


@mutant("OPN-14", check=LETS_GO, code="no-frame", at=server.HEARS_OF_MEMORY)
def server_waits_for_the_release_of_what_failed(original, self, connection, message):
    """Takes a frame for held until it is released or its memory closed; not if that failed."""
    if isinstance(message, OpenFailed):
        return server_waits_for_the_release(original, self, connection, message)
    return original(self, connection, message)


@mutant("IMG-5", check="check_images_of_another_size_are_right", code="other-pixels")
def server_keeps_the_lens_of_the_first_size(patch):
    """Renders images of all sizes with the focal length in pixels that the first had."""
    first: list[Any] = []

    def former(camera):
        first.append(camera)
        return replace(camera, fx=first[0].fx, fy=first[0].fy)

    cameras(patch, former)


@mutant(
    "VPT-4",
    check="check_obeys_who_has_control",
    code="another-answer",
    at=server.HINDERS_OTHER_SIZE,
)
def server_obeys_who_waits_for_control(original, self, asker):
    """Changes the size for a client that has posed, though another one has control."""
    refusal: Refusal | None = original(self, asker)
    stands = refusal is not None and "steers" in refusal.reason
    return None if stands and asker in self.control.sent else refusal


@mutant(
    "VPT-10", check="check_is_not_busy_for_ever", code="busy-for-ever", at=server.HINDERS_OTHER_SIZE
)
def server_keeps_the_second_size_for_ever(original, self, asker):
    """Says `busy` from the second change on, as one does that never has former memory freed."""
    if self.exchange.memory.generation > 1:
        return Refusal("busy", "memory of the former size is in use")
    given: Refusal | None = original(self, asker)
    return given


@mutant("NEG-41", code="owns-up", through="VPT-2", at=server.BEGINS_OTHER_SIZE)
def server_fails_at_other_sizes(original, self, *arguments):
    """Answers every change of size by `internal`."""
    raise KeyError("size")
