"""Mutants of clients whose images in memory of a GPU show what is broken, on a real one too."""

import time

from splatbus_client.cuda import images
from splatbus_client.cuda.driver import Device, api, call
from splatbus_client.cuda.images import CudaImages
from splatbus_client.host_memory import CannotOpenError
from splatbus_client.reading import Loan

from tests.zoo.faults.driver import without
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, cuda, viewer
from tests.zoo.mutant import mutant
from tests.zoo.mutants.device.buffers import absent_offset, first_size
from tests.zoo.mutants.device.frames import first_event, slot_before
from tests.zoo.mutants.simulated.clients import releases_at_once

AFTER_ITS_EVENT = "check_reads_a_frame_after_its_event"
HAS_READ = "check_releases_when_it_has_read"


def first_device(patch):
    """Take every device for the first."""

    def first(original, wanted):
        call(api.cuInit, 0)
        return Device(0)

    for seam in (cuda.DEVICE_BY_NUMBER, Seam(images, "device")):
        seam.wrap(patch, first)


@mutant("BUF-11", check="check_reads_no_image_before_its_event", code="read-before-event")
def shows_an_image_before_its_event(patch):
    """Shows buffers without a wait for their event."""
    without(patch, "cuStreamWaitEvent")


@mutant("INI-8", check="check_reads_what_the_packet_names", code="ignores")
def shows_what_no_offset_names(patch):
    """Shows what begins at byte 16 where no offset is named."""
    absent_offset(patch)


@mutant("CHN-24", check="check_reads_the_new_memory", code="ignores")
def shows_new_memory_in_the_first_size(patch):
    """Shows new memory as if its images had the size of the first."""
    first_size(patch)


@mutant("CUD-6", check="check_opens_nothing_on_another_device", code="another-device")
def shows_what_lies_on_no_device(patch):
    """Opens on device 0 what is said to lie on another."""
    first_device(patch)


@mutant("IMG-8", check=AFTER_ITS_EVENT, code="read-before-event")
def shows_a_frame_before_its_event(patch):
    """Shows frames without a wait for the event of their slot."""
    without(patch, "cuStreamWaitEvent")


@mutant("IMG-8", check=AFTER_ITS_EVENT, code="read-before-event")
def shows_a_frame_after_the_first_slot_s_event(patch):
    """Waits for the event of the first slot, whichever it shows."""
    first_event(patch)


@mutant("IMG-8", check=AFTER_ITS_EVENT, code="read-before-event")
def shows_another_slot(patch):
    """Shows another slot than the one that it is lent, whose event it waits for."""
    slot_before(patch)


@mutant("IMG-13", check=HAS_READ, code="released-too-early")
def releases_another_slot_than_it_shows(patch):
    """Shows another slot than the one that it is lent and releases."""
    slot_before(patch)


@mutant("IMG-13", check=HAS_READ, code="released-too-early", at=Seam(CudaImages, "color"))
def shows_what_lies_beside_the_image(original, self, slot):
    """Reads colour from 16 bytes too far."""
    array = original(self, slot)
    array.pointer += 16
    return array


@mutant("IMG-13", check=HAS_READ, code="released-too-early")
def releases_the_device_before_it_reads(patch):
    """Gives a frame back as soon as it has it, and copies it a moment later."""

    def copy(original, *arguments):
        time.sleep(0.05)
        return original(*arguments)

    releases_at_once.specimens[0].alter(patch)
    Seam(CudaImages, "on_host").wrap(patch, copy)


def handed_out(patch):
    """The frame that was handed out last, whether or not it is lent still."""

    def hold(original, self):
        held[:] = [original(self)]
        return held[0]

    held: list[Loan] = []
    client.HANDS_OUT.wrap(patch, hold)
    return held


def color_of(loan):
    """What lies there now."""
    images, slot = loan.mapped.images, loan.frame.slot
    return images.copied("color", slot, images.color(slot))


@mutant("IMG-14", check="check_reads_only_what_it_holds", code="read-without-lease")
def shows_what_it_does_not_hold(patch):
    """Shows what lies in the slot a moment after it has released the frame."""

    def read(original, self, timeout):
        original(self, timeout)
        time.sleep(0.05)
        for loan in held:
            self.newest = self.newest._replace(color=color_of(loan))

    held = handed_out(patch)
    viewer.READS_FRAME.wrap(patch, read)


@mutant("INI-13", check="check_goes_on_without_device_memory", code="accepts")
def says_that_it_has_opened_what_it_has_not(patch):
    """Answers `opened` to what it could not open."""
    client.SAYS_OPEN_FAILED.wrap(patch, lambda original, self, packet, reason: self.opened(packet))


@mutant("OPN-1", check="check_opens_device_memory", code="open-failed", at=cuda.BEGINS_WITH_RING)
def declines_good_memory_of_a_device(original, self, packet):
    """Declines every ring in memory of a GPU."""
    original(self, packet)
    raise CannotOpenError("no")


@mutant("CHN-18", check="check_leaves_the_buffers_when_the_connection_ends", code="read-after-end")
def shows_memory_whose_connection_has_ended(patch):
    """Shows what lies in the slot that it read last while it is not connected."""

    def newest(self):
        if self.kept is None or self.session.status.ipc.connected:
            return self.kept
        try:
            return self.kept._replace(color=color_of(held[0]))
        except ValueError:  # memory of the host is not mapped any more
            return self.kept

    def keep(self, image):
        self.kept = image

    held = handed_out(patch)
    without(patch, "cuIpcCloseMemHandle", "cuEventDestroy", "cuStreamDestroy")
    viewer.NEWEST_IMAGE.replace(patch, property(newest, keep))
