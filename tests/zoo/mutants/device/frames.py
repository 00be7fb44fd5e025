"""Mutants of clients that break what is said of frames in memory of a GPU."""

import threading

from splatbus_client.reading import Reading

from tests.zoo.faults.driver import calls, without
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, cuda
from tests.zoo.mutant import mutant

WAITS = "check_reads_a_frame_after_its_event"
LEASED = "check_reads_only_what_it_holds"


def first_event(patch):
    """Wait for the event of the first slot, whichever is read."""
    opened = []

    def open_(call, function, *given):
        opened.append(call(function, *given))
        return opened[-1]

    def wait(call, function, stream, event, flags):
        call(function, stream, opened[0], flags)

    def begin(original, self, packet):
        opened.clear()
        original(self, packet)

    calls(patch, "cuIpcOpenEventHandle", around=open_)
    calls(patch, "cuStreamWaitEvent", around=wait)
    cuda.BEGINS_WITH_RING.wrap(patch, begin)


def slot_before(patch):
    """Read the slot before the one that is lent, or the one behind the first."""

    def take(original, self, frame, channels):
        slot = frame.slot - 1 if frame.slot else 1
        original(self, frame._replace(slot=slot), channels)

    client.IS_LENT_FRAME.wrap(patch, take)


@mutant("IMG-8", check=WAITS, code="read-before-event")
def waits_for_no_event_of_a_slot(patch):
    """Reads frames without a wait for the event of their slot."""
    without(patch, "cuStreamWaitEvent")


@mutant("IMG-8", check=WAITS, code="read-before-event")
def waits_for_the_event_of_the_first_slot(patch):
    """Waits for the event of the first slot, whichever it reads."""
    first_event(patch)


@mutant(
    "IMG-12",
    check="check_releases_each_frame_once",
    code="not-released",
    at=client.RELEASES,
)
def releases_every_other_frame(original, self, frame):
    """Releases no frame of the first slot."""
    if frame.slot:
        original(self, frame)


@mutant("IMG-13", check="check_releases_when_it_has_read", code="released-too-early")
def releases_what_it_still_reads(patch):
    """Waits for no copy before it releases the frame."""
    without(patch, "cuStreamSynchronize", "cuCtxSynchronize")


@mutant("IMG-14", check=LEASED, code="read-without-lease", at=Seam(Reading, "give_back"))
def reads_once_more_after_the_release(original, self, loan):
    """Reads the slot again a moment after it has released the frame."""
    original(self, loan)
    images, slot = loan.mapped.images, loan.frame.slot
    again = threading.Timer(0.05, lambda: images.on_host("color", slot, images.color(slot)))
    again.start()


@mutant("IMG-14", check=LEASED, code="read-without-lease")
def reads_the_slot_before(patch):
    """Reads another slot than the one that it is lent."""
    slot_before(patch)
