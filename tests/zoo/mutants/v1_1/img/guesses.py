"""Mutants that compute what they should read, or hold it in too few bits; and that keep the slot of
a frame which they cannot use.
"""

import json

from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import Closed, Release, encode

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, viewer
from tests.zoo.faults.surgery import crash
from tests.zoo.mutant import mutant

UNUSABLE = "check_releases_frames_that_it_cannot_use"
UNREADABLE = "check_ignores_frames_of_no_image"


@mutant(
    "IMG-14",
    check="check_reads_only_what_it_holds",
    code="read-without-lease",
    axes="opencv",
    at=client.IS_LENT_FRAME,
)
def guesses_the_slot(original, self, frame, channels):
    """Reads the slot that the number of an image would have in a ring that goes round."""
    assert self.mapped is not None
    slots = self.mapped.images.ring.slots  # type: ignore[attr-defined]
    original(self, frame._replace(slot=frame.seq % slots), channels)


@mutant(
    "IMG-14",
    check="check_reads_only_what_it_holds",
    code="read-without-lease",
    axes="opencv",
    at=client.OPENS_MEMORY,
)
def guesses_the_layout(original, packet):
    """Takes the ring for colour without gaps, and depth behind it."""
    ring = packet.ring
    assert ring is not None
    color, depth = 16 * packet.width * packet.height, 4 * packet.width * packet.height
    tight = ring._replace(
        color_offset=0,
        color_stride=color,
        depth_offset=ring.slots * color,
        depth_stride=-(-depth // 16) * 16,
    )
    return original(packet._replace(ring=tight))


@mutant(
    "IMG-12",
    check="check_releases_each_frame_once",
    code="not-released",
    at=Seam(IpcProtocol, "is_open"),
)
def has_three_slots(original, self, generation, slot):
    """Keeps three slots of a ring, and takes a frame of a later one for a mistake."""
    return slot < 3 and bool(original(self, generation, slot))


@mutant(
    "MEM-13",
    check="check_shows_images_by_their_semantics",
    code="another-depth-kind",
    axes="opencv",
    at=viewer.RAYS_OF_PIXELS,
)
def takes_the_principal_point_for_the_middle(original, camera):
    """Computes the ray of a pixel as if the camera looked through the middle of the image."""
    return original(camera._replace(cx=camera.width / 2, cy=camera.height / 2))


def _shortens(patch, member):
    """Hold a member of a frame in 32 bits."""

    def decode(original, payload):
        if payload.startswith(b'{"type":"frame"'):
            frame = json.loads(payload)
            if isinstance(number := frame.get(member), int):
                payload = json.dumps(frame | {member: number % (1 << 32)}).encode()
        return original(payload)

    client.READS_ON_IPC.wrap(patch, decode)


@mutant("IMG-12", check="check_releases_each_frame_once", code="not-released")
def holds_image_numbers_in_32_bits(patch):
    """Has 32 bits for the number of an image."""
    _shortens(patch, "seq")


@mutant(
    "IMG-12", check="check_releases_each_frame_once", code="not-released", at=client.TAKES_FRAME
)
def holds_image_numbers_in_single_precision(original, self, frame):
    """Reads the number of an image as one of single precision."""
    return original(self, frame._replace(seq=frame.seq & ~1 if frame.seq >> 24 else frame.seq))


@mutant(
    "IMG-12", check="check_releases_each_frame_once", code="not-released", at=client.TAKES_FRAME
)
def takes_the_first_number_for_none(original, self, frame):
    """Takes an image whose number is 0 for none at all."""
    return original(self, frame) if frame.seq else []


@mutant(
    "IMG-12", check="check_releases_each_frame_once", code="not-released", at=client.TAKES_FRAME
)
def takes_the_last_number_for_none(original, self, frame):
    """Takes the greatest number of an image for none at all."""
    return [] if frame.seq == 2**53 - 1 else original(self, frame)


@mutant("IMG-15", check="check_ignores_frames_of_no_image", code="accepts")
def holds_generations_of_frames_in_32_bits(patch):
    """Has 32 bits for the generation of a frame."""
    _shortens(patch, "generation")


@mutant("OPN-5", check="check_closes_the_former_memory", code="not-closed", at=client.SAYS_CLOSED)
def guesses_the_former_generation(original, self, generation):
    """Says that it has closed the generation before the newest, as if they were counted."""
    if generation in self.retired:
        self.retired.remove(generation)
        del self.slots[generation]
        self.send(Closed(self.last_generation - 1))


@mutant(
    "INI-8", check="check_accepts_good_init_packets", code="not-opened", at=client.TAKES_INIT_PACKET
)
def takes_generations_from_one_on_alone(original, self, packet):
    """Takes the first init packet of a connection for a further one unless its generation is 1."""
    first = not self.last_generation
    return iter(()) if first and packet.generation != 1 else original(self, packet)


def _keeps(patch, *pointers):
    """Do not give back the slot of a frame that is broken at one of these places."""

    def on_broken(original, self, payload, problem):
        if b'"frame"' in payload and any(f"at {pointer}" in problem for pointer in pointers):
            return iter(())
        return original(self, payload, problem)

    client.TAKES_BROKEN_PACKET.wrap(patch, on_broken)


@mutant("IMG-24", check=UNUSABLE, code="not-released")
def keeps_the_slot_of_a_frame_without_a_camera(patch):
    """Does not give back a frame whose camera is missing or no object."""
    _keeps(patch, "/camera [")


@mutant("IMG-24", check=UNUSABLE, code="not-released")
def keeps_the_slot_of_a_frame_without_a_rotation(patch):
    """Does not give back a frame whose camera has a rotation that is none."""
    _keeps(patch, "/camera/rotation")


@mutant("IMG-24", check=UNUSABLE, code="not-released", at=client.IS_LENT_FRAME)
def keeps_the_slot_of_a_frame_of_another_width(original, self, frame, channels):
    """Does not give back a frame whose camera has another width than its memory."""
    assert self.mapped is not None
    if frame.camera.width == self.mapped.images.size[0]:
        original(self, frame, channels)


@mutant("IMG-24", check=UNUSABLE, code="not-released")
def keeps_the_slot_of_a_frame_without_time(patch):
    """Does not give back a frame whose time is missing or no number."""
    _keeps(patch, "/time")


@mutant("IMG-24", check=UNUSABLE, code="not-released")
def keeps_the_slot_of_a_frame_with_odd_objects(patch):
    """Does not give back a frame whose objects are malformed."""
    _keeps(patch, "/objects")


@mutant("IMG-24", check=UNUSABLE, code="dies", at=client.READS_ON_IPC)
def crashes_on_a_malformed_frame(original, payload):
    """Crashes on a frame that lacks a member."""
    try:
        return original(payload)
    except ProtocolError as problem:
        if b'"frame"' in payload and "is missing" in str(problem):
            crash()
        raise


@mutant("IMG-24", check="check_releases_frames_whose_numbers_do_not_grow", code="not-released")
def keeps_the_slot_of_a_frame_that_is_not_newer(patch):
    """Drops a frame whose number is not greater than that of the one before, and keeps its slot."""

    def on_frame(original, self, frame):
        newer = frame.seq > newest.get(self, -1)
        newest[self] = max(frame.seq, newest.get(self, -1))
        return original(self, frame) if newer else iter(())

    newest: dict[IpcProtocol, int] = {}
    client.TAKES_FRAME.wrap(patch, on_frame)


def _releases_what_is_broken(patch, member, number):
    """Give back a frame that has no such member, or none that can be read, as if it had this."""

    def on_broken(original, self, payload, problem):
        if b'"frame"' in payload and f"at /{member} " in problem:
            frame = json.loads(payload) | {member: number}
            self.unsent += encode(Release(frame["generation"], frame["seq"]))
            return iter(())
        return original(self, payload, problem)

    client.TAKES_BROKEN_PACKET.wrap(patch, on_broken)


@mutant("IMG-15", check=UNREADABLE, code="accepts")
def releases_a_frame_without_a_slot(patch):
    """Gives back a frame that names no slot."""
    _releases_what_is_broken(patch, "slot", 0)


@mutant("IMG-15", check=UNREADABLE, code="accepts")
def releases_a_frame_without_a_number(patch):
    """Takes a frame without a number for number 0, and gives it back."""
    _releases_what_is_broken(patch, "seq", 0)


@mutant("IMG-15", check=UNREADABLE, code="accepts")
def releases_a_frame_without_a_generation(patch):
    """Takes a frame without a generation for one of the first, and gives it back."""
    _releases_what_is_broken(patch, "generation", 1)
