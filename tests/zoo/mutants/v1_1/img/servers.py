"""Mutants that break IMG: which images they make, and which frames they send."""

from dataclasses import replace
from typing import Any

from splatbus_server.exchange import BOTH, Exchange, Image
from splatbus_server.reader import Reader
from splatbus_wire.messages import OpenFailed, SetTime

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant

FURTHEST = 1_000_000
RESTS = "check_publishes_what_changed_only"


@mutant("IMG-1", code="missing-member")
def server_tells_no_focal_length(patch):
    """Leaves an intrinsic out of the camera of a frame."""

    def change(frame):
        return frame | {"camera": {n: v for n, v in frame["camera"].items() if n != "fx"}}

    messages(patch, of_type("frame", change))


@mutant("IMG-1", code="not-growing", through="IMG-2")
def server_counts_images_down(patch):
    """Gives each image a number less than the last."""
    messages(patch, of_type("frame", lambda frame: frame | {"seq": FURTHEST - frame["seq"]}))

    def release(original, self, connection, message):
        return original(self, connection, message._replace(seq=FURTHEST - message.seq))

    server.TAKES_IMAGE_BACK.wrap(patch, release)


def lends_unopened(patch):
    """Take whoever was sent an init packet for one who has opened the memory."""

    def announce(original, self, to, reader, memory, now):
        original(self, to, reader, memory, now)
        reader.opened.add(memory.generation)

    server.ANNOUNCES_MEMORY.wrap(patch, announce)


@mutant("IMG-2", check="check_lends_one_at_a_time", code="before-opened")
def server_lends_at_once(patch):
    """Sends a frame behind the init packet."""
    lends_unopened(patch)


@mutant("IMG-2", code="not-opened", through="IMG-2")
def server_does_not_wait_for_opened(patch):
    """Sends a frame behind the init packet."""
    lends_unopened(patch)


@mutant("IMG-2", check="check_lends_one_at_a_time", code="another-frame", at=server.LENDS_IMAGE)
def server_takes_images_back(original, self, to, reader, memory):
    """Ends each lease as soon as the frame is sent, and sends the next image when there is one."""
    original(self, to, reader, memory)
    if reader.lease is not None:
        self.exchange.take_back(to, reader.lease)
        reader.lease = None


def grants_frames(patch):
    """Take every reader for one that declared frames."""

    def has(original, self, capability):
        return original(self, capability) or (capability == "frames" and self.channel == "ipc")

    server.ASKS_WHAT_WAS_AGREED.wrap(patch, has)


@mutant(
    "IMG-23",
    check="check_sends_no_frames_that_were_not_agreed",
    code="not-granted",
)
def server_sends_frames_to_all(patch):
    """Sends frames to whoever has opened the memory."""
    grants_frames(patch)


@mutant("IMG-23", code="not-granted", through="IMG-23")
def server_forgets_who_takes_frames(patch):
    """Sends frames to whoever has opened the memory."""
    grants_frames(patch)


@mutant("IMG-3", check="check_announces_the_newest", code="not-the-newest")
def server_lends_the_image_before(patch):
    """Lends one who has missed images the last but one."""
    shown: dict[int, Image] = {}
    had: dict[Any, int] = {}

    def lend(original, self, client, memory, wants):
        image: Image | None = original(self, client, memory, wants)
        if image is None:
            return None
        shown[image.seq] = image
        missed, had[client] = image.seq - had.get(client, image.seq), image.seq
        former = shown.get(image.seq - 1)
        return image._replace(view=former.view) if missed > 1 and former else image

    server.LEASES_NEWEST.wrap(patch, lend)


@mutant("IMG-10", check=RESTS, code="published-unprompted", at=server.NEXT_VIEW)
def server_never_rests(original, self, timeout, changed):
    """Renders as often as it can, whether or not anything moves."""
    return original(self, timeout, True)


@mutant("IMG-10", check=RESTS, code="published-unchanged", at=Seam(Exchange, "move"))
def server_renders_each_pose(original, self, *arguments):
    """Renders whenever a pose comes, even if it is the same."""
    self.shown = None
    original(self, *arguments)


@mutant("IMG-11", check="check_sends_what_is_new", code="no-frame", at=server.TAKES_IMAGE_BACK)
def server_forgets_who_was_reading(original, self, connection, message):
    """Sends each image when it is made, and to nobody who was still reading another then."""
    ring = self.exchange.memory.ring
    if ring.newest is not None:
        ring.seen[connection] = ring.newest.seq
    return original(self, connection, message)


MORE = "check_shows_what_is_newly_subscribed_to"


@mutant("IMG-25", check=MORE, code="no-frame")
def server_lets_a_scene_rest(patch):
    """Makes no image for a subscription, unless the newest lacks what is wanted."""
    server.OWES_MORE.replace(patch, lambda self, client, memory: None)


@mutant("IMG-25", check=MORE, code="no-frame", at=Seam(Reader, "take"))
def server_takes_the_first_image_for_readable(original, self, image):
    """Makes one image for a subscription, though a release from before it lets that be sent."""
    original(self, image)
    self.readable = self.wants


@mutant("IMG-25", check=MORE, code="no-frame", at=Seam(Reader, "subscribe"))
def server_forgets_what_was_given_up(original, self, channels):
    """Goes by what a reader wanted when it began to wait, and by what it wants now."""
    self.wants = channels


@mutant(
    "IMG-25",
    check="check_shows_it_beside_who_reads_both",
    code="no-frame",
    at=server.TAKES_SUBSCRIPTION,
)
def server_takes_what_others_read_for_readable(original, self, connection, channels):
    """Lets a reader go without the next image where the newest has depth, made for another."""
    refusal = original(self, connection, channels)
    newest, reader = self.exchange.newest, self.readers[connection]
    if newest is not None and channels <= newest.view.wants:
        reader.kept = reader.readable = channels
    return refusal


@mutant(
    "IMG-21", check="check_writes_only_what_is_wanted", code="written-unwanted", at=server.NEXT_VIEW
)
def server_writes_both_always(original, *arguments):
    """Writes colour and depth, whatever its readers subscribe to."""
    view = original(*arguments)
    return view if view is None else replace(view, wants=BOTH)


NOTHING = "check_publishes_nothing_for_what_changes_nothing"


def published_after(patch, is_reason):
    """Make a further image of what is shown after some messages that steer."""

    def move(original, self, connection, message):
        refusal = original(self, connection, message)
        if is_reason(message, refusal):
            with self.exchange.lock:
                self.exchange.shown = None
                self.exchange.changed.notify_all()
        return refusal

    server.TAKES_POSE.wrap(patch, move)


@mutant("IMG-10", check=NOTHING, code="published-unchanged")
def server_publishes_when_it_refuses(patch):
    """Makes a further image when it has refused a pose."""
    published_after(patch, lambda message, refusal: refusal is not None)


@mutant("IMG-10", check=NOTHING, code="published-unchanged")
def server_publishes_at_the_same_time(patch):
    """Makes a further image for a time, though the scene was shown at that already."""
    published_after(patch, lambda message, refusal: isinstance(message, SetTime))


@mutant(
    "IMG-2",
    check="check_lends_nothing_after_closed",
    code="after-closed",
    at=server.HEARS_OF_MEMORY,
)
def server_lends_after_open_failed(original, self, connection, message):
    """Goes on lending to a reader that says, after `opened`, that it could not open the memory."""
    reader = self.readers.get(connection)
    opened = set(reader.opened) if reader else set()
    refusal = original(self, connection, message)
    if reader is not None and isinstance(message, OpenFailed):
        reader.opened |= opened
    return refusal
