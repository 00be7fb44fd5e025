"""Mutants of servers that break what is said of images in memory of a GPU."""

import threading
from contextlib import suppress

from splatbus_renderer.scene import default_scene
from splatbus_server.cuda.driver import CudaError, api, call
from splatbus_wire.messages import Closed

from tests.zoo.faults import device
from tests.zoo.faults.driver import calls, without
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.cnv.servers import server_puts_the_scene_elsewhere_at_first
from tests.zoo.mutants.v1_0.pos import servers as poses
from tests.zoo.mutants.v1_1.mem.servers import announces
from tests.zoo.variations.server_unhurried import drawing, showing

AFTER_THE_IMAGE = "check_records_the_event_after_the_image"
BEFORE_THE_FRAME = "check_records_the_event_before_the_frame"
EXPORTS = "check_exports_nothing_but_buffers"
FLAGS = "check_creates_the_event_with_its_flags"
KEEPS = "check_keeps_memory_while_a_connection_is_open"
LATE_SECONDS = 0.03
NON_BLOCKING, UNTIMED, INTERPROCESS = 1, 2, 4


# Events


@mutant("BUF-10", check=AFTER_THE_IMAGE, code="event-not-recorded")
def server_records_no_event(patch):
    """Writes four images a second, and never records their event."""
    drawing(patch, 4.0)
    without(patch, "cuEventRecord")


@mutant("BUF-10", check=AFTER_THE_IMAGE, code="recorded-too-late", at=device.RECORDS)
def server_records_on_another_stream(original, self):
    """Records the event on a stream that nothing orders behind the copies."""
    self.stream, usual = call(api.cuStreamCreate, NON_BLOCKING), self.stream
    original(self)
    self.stream = usual


def records_before(patch, dimensions):
    """Record before the plane of so many dimensions is copied, not behind both."""
    record = device.Launch.record

    def copy(original, self, place, plane):
        if plane.ndim == dimensions:
            record(self)
        original(self, place, plane)

    device.COPIES.wrap(patch, copy)
    device.RECORDS.replace(patch, lambda self: None)


@mutant("BUF-10", check=AFTER_THE_IMAGE, code="recorded-too-late")
def server_records_before_it_writes(patch):
    """Records the event of the image before, when it writes the next."""
    records_before(patch, 3)


@mutant("BUF-10", check=AFTER_THE_IMAGE, code="recorded-too-early")
def server_records_between_colour_and_depth(patch):
    """Records the event behind the colour; clears nothing before the first image."""
    without(patch, "cuMemsetD8Async", "cuMemsetD32Async")
    records_before(patch, 2)


@mutant("CUD-3", check=FLAGS, code="missing-flag")
def server_creates_events_for_one_process(patch):
    """Creates events of which nobody gets a handle."""
    calls(patch, "cuEventCreate", around=lambda call, create, flags: call(create, UNTIMED))
    exports_what_it_may(patch, "cuIpcGetEventHandle", api.CUipcEventHandle)


@mutant("CUD-3", check=FLAGS, code="missing-flag")
def server_tries_events_that_take_the_time(patch):
    """Asks for an event that takes the time before it asks for another."""

    def create(call, create, flags):
        with suppress(CudaError):
            call(create, INTERPROCESS)
        return call(create, flags)

    calls(patch, "cuEventCreate", around=create)


@mutant("IMG-7", check=BEFORE_THE_FRAME, code="event-not-recorded", at=device.RECORDS)
def server_records_after_the_frame(original, self):
    """Records the event of a slot when the frame is on its way."""
    threading.Timer(LATE_SECONDS, original, (self,)).start()


@mutant("IMG-7", check=BEFORE_THE_FRAME, code="event-not-recorded")
def server_records_the_event_of_its_first_slot(patch):
    """Records the event of the slot that it wrote first, whichever it writes."""
    first = []

    def record(original, self):
        first.append(self)
        original(first[0])

    device.RECORDS.wrap(patch, record)


@mutant("IMG-7", check=BEFORE_THE_FRAME, code="event-not-recorded")
def server_writes_behind_the_event(patch):
    """Touches its images up when their event is recorded."""
    written = []

    def copy(original, self, *what):
        written.append(what)
        original(self, *what)

    def record(original, self):
        original(self)
        device.Launch.copy(self, *written[-1])

    device.COPIES.wrap(patch, copy)
    device.RECORDS.wrap(patch, record)


# Memory


def exports_what_it_may(patch, name, structure):
    """Give out a handle of nothing where the driver refuses one."""

    def handle(call, function, *of):
        with suppress(CudaError):
            return call(function, *of)
        return structure()

    calls(patch, name, around=handle)


@mutant("CUD-1", check=EXPORTS, code="not-exportable")
def server_exports_memory_of_the_host(patch):
    """Asks for the handle of memory of the host."""
    exports_what_it_may(patch, "cuIpcGetMemHandle", api.CUipcMemHandle)
    calls(
        patch,
        "cuIpcGetMemHandle",
        around=lambda usual, export, pointer: usual(export, call(api.cuMemHostAlloc, 64, 0)),
    )


@mutant("CUD-1", check=EXPORTS, code="more-than-images", at=device.COPIES)
def server_keeps_more_than_images(original, self, place, plane):
    """Keeps something of its own behind the last image."""
    original(self, place, plane)
    original(self, place + plane.nbytes, plane[:1])


def frees(patch, when, creates, free):
    """Free the first thing that this call created, when a step of the server is over; go on."""
    made = []

    def go_on(call, function, *given):
        with suppress(CudaError):
            call(function, *given)

    def create(call, function, *given):
        made.append(call(function, *given))
        return made[-1]

    def step(original, self, connection, *given):
        found = original(self, connection, *given)
        if made and not (given and not isinstance(given[-1], Closed)):
            call(free, made.pop(0))
        return found

    calls(patch, creates, around=create)
    when.wrap(patch, step)
    calls(patch, "cuStreamWaitEvent", "cuMemcpyHtoDAsync", "cuEventRecord", around=go_on)


@mutant("CUD-4", check=KEEPS, code="freed-too-early")
def server_frees_memory_when_a_client_leaves(patch):
    """Frees memory that other clients have, when one leaves."""
    frees(patch, server.FORGETS_CLIENT, "cuMemAlloc", api.cuMemFree)


@mutant("CUD-4", check=KEEPS, code="freed-too-early")
def server_destroys_an_event_when_a_client_leaves(patch):
    """Destroys the event that other clients wait for, when one leaves."""
    frees(patch, server.FORGETS_CLIENT, "cuEventCreate", api.cuEventDestroy)


@mutant("OPN-8", check="check_keeps_memory_while_somebody_has_it", code="freed-too-early")
def server_frees_memory_that_one_reader_closed(patch):
    """Takes one reader's `closed` for everybody's, and frees the memory."""
    frees(patch, server.HEARS_OF_MEMORY, "cuMemAlloc", api.cuMemFree)


@mutant("MEM-2", check="check_announces_device_memory_that_is_there", code="not-openable")
def server_announces_more_memory_than_there_is(patch):
    """Announces a gibibyte."""
    announces(patch, memory={"bytes": 1 << 30})


# Poses


@mutant("POS-13", check="check_the_scene_of_a_new_server_is_at_rest", code="not-at-rest")
def server_puts_the_scene_elsewhere_on_a_device(patch):
    """Begins with Gaussians that were moved."""
    server_puts_the_scene_elsewhere_at_first(patch)


def of_another_scene(patch):
    """Lend nothing, and show what nobody knows: that tells of poses by how they look alone."""
    server.CAPABILITIES_ON_IPC.replace(patch, ())
    showing(patch, *default_scene().spheres[1:4])


@mutant("POS-5", check="check_takes_members_by_name", code="ignores")
def server_of_another_scene_takes_members_as_they_come(patch):
    """Takes the numbers of a rotation in the order in which they stand."""
    of_another_scene(patch)
    poses.server_takes_members_as_they_come(patch)


@mutant("POS-6", check="check_keeps_the_former_pose", code="applies")
def server_of_another_scene_scales_every_rotation(patch):
    """Makes a unit quaternion of every rotation."""
    of_another_scene(patch)
    poses.server_scales_every_rotation(patch)


@mutant("POS-11", check="check_one_connection_has_control", code="applied-without-control")
def server_of_another_scene_obeys_everyone(patch):
    """Applies the newest pose, whoever sent it."""
    of_another_scene(patch)
    poses.server_obeys_everyone.specimens[0].alter(patch)
