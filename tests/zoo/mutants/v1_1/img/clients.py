"""Mutants that break IMG: `frame`, `release`, `subscribe`."""

from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_wire import from_server
from splatbus_wire.messages import Release, Subscribe, encode

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import crash, messages, of_type
from tests.zoo.mutant import mutant


@mutant("IMG-12", check="check_releases_each_frame_once", code="released-twice", at=client.RELEASES)
def releases_twice(original, self, frame):
    """Releases each frame twice."""
    self.unsent += encode(Release(frame.generation, frame.seq))
    original(self, frame)


@mutant("IMG-12", check="check_releases_each_frame_once", code="not-released", at=client.RELEASES)
def loses_every_tenth_release(original, self, frame):
    """Does not release every tenth frame."""
    if frame.seq % 10:
        original(self, frame)


@mutant(
    "IMG-12", check="check_releases_each_frame_once", code="not-released", at=client.TAKES_FRAME
)
def keeps_frames_that_list_objects(original, self, frame):
    """Drops a frame that lists objects, and keeps its slot."""
    return [] if frame.objects else original(self, frame)


@mutant("IMG-12", code="unknown-image", through="IMG-12")
def releases_with_another_generation(patch):
    """Names another generation in `release` than the `frame` did."""
    messages(patch, of_type("release", lambda release: release | {"generation": 7}))


@mutant("IMG-15", check="check_ignores_frames_of_no_image", code="accepts", at=client.TAKES_FRAME)
def releases_frames_of_any_generation(original, self, frame):
    """Takes every frame for one of the memory that it has open."""
    if frame.generation not in self.slots:
        self.unsent += encode(Release(frame.generation, frame.seq))
        return []
    return original(self, frame)


@mutant("IMG-15", check="check_ignores_frames_of_closed_memory", code="accepts")
def releases_frames_of_closed_memory(patch):
    """Gives back every frame of memory that it had open once."""
    closed: set[tuple[IpcProtocol, int]] = set()

    def close(original, self, generation):
        closed.add((self, generation))
        original(self, generation)

    def on_frame(original, self, frame):
        if (self, frame.generation) in closed:
            self.unsent += encode(Release(frame.generation, frame.seq))
            return []
        return original(self, frame)

    client.SAYS_CLOSED.wrap(patch, close)
    client.TAKES_FRAME.wrap(patch, on_frame)


@mutant("IMG-15", check="check_ignores_frames_of_no_image", code="dies", at=client.TAKES_FRAME)
def reads_slots_that_do_not_exist(original, self, frame):
    """Reads beyond the ring when a frame names a slot that does not exist, and dies of it."""
    if frame.slot >= self.slots.get(frame.generation, frame.slot + 1):
        crash()
    return original(self, frame)


@mutant("IMG-19", code="not-an-array")
def subscribes_to_one_channel_as_a_string(patch):
    """Names one channel instead of an array of them."""
    subscribes(patch, "color", "depth")
    messages(patch, of_type("subscribe", lambda subscribe: subscribe | {"channels": "color"}))


@mutant("IMG-19", code="not-an-array")
def subscribes_to_nothing(patch):
    """Subscribes to no channel at all."""
    subscribes(patch)


def subscribes(patch, *channels):
    """Subscribe to these channels as soon as that is agreed."""

    def on_welcome(original, self, welcome):
        yield from original(self, welcome)
        if "subscribe" in self.capabilities:
            self.unsent += encode(Subscribe(frozenset(channels)))

    client.TAKES_WELCOME_ON_IPC.wrap(patch, on_welcome)


@mutant(
    "JSN-6",
    check="check_reads_what_is_lent_in_any_spelling",
    code="not-read",
    axes="opencv",
    at=Seam(from_server, "frame"),
)
def reads_frames_of_one_spelling(original, fields):
    """Gives back unread what is lent by a frame that is not spelled as frames usually are."""
    raise fields.refused("is spelled otherwise")
