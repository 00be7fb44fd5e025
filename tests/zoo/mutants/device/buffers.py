"""Mutants of clients that break what 1.0 says of buffers in memory of a GPU."""

import threading
import time

from splatbus_client.cuda import legacy
from splatbus_client.cuda.driver import Device, api, call, filled
from splatbus_client.cuda.images import opened_memory
from splatbus_client.cuda.opened import Allocation
from splatbus_client.events import MustClose

from tests.zoo.faults.driver import calls, without
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, cuda
from tests.zoo.faults.surgery import init_packets
from tests.zoo.mutant import mutant

WAITS = "check_reads_no_image_before_its_event"
GIVES_BACK = "check_gives_memory_back"
OPENS_ONCE = "check_opens_each_handle_once"
ON_THE_DEVICE = "check_opens_on_the_device_named"
NEW_MEMORY = "check_reads_the_new_memory"
NAMED = "check_reads_what_the_packet_names"


@mutant("BUF-11", check=WAITS, code="read-before-event")
def waits_for_no_event(patch):
    """Reads buffers without a wait for their event."""
    without(patch, "cuStreamWaitEvent")


@mutant("BUF-11", check=WAITS, code="read-before-event")
def waits_for_each_event_once(patch):
    """Waits for an event before it reads the first image, and before no other."""
    waited = set()

    def wait(call, function, stream, event, flags):
        if int(event) not in waited:
            waited.add(int(event))
            call(function, stream, event, flags)

    calls(patch, "cuStreamWaitEvent", around=wait)


@mutant("BUF-11", check=WAITS, code="not-waited")
def waits_on_another_stream(patch):
    """Makes the default stream wait for the event, and copies on another."""
    calls(
        patch,
        "cuStreamWaitEvent",
        around=lambda call, function, stream, *event: call(function, 0, *event),
    )


@mutant("BUF-11", check=WAITS, code="not-waited")
def copies_depth_on_a_stream_that_waits_for_nothing(patch):
    """Copies the depth on a stream of its own, which nothing orders."""
    copied = []

    def copy(call, function, *place):
        copied.append(place)
        is_depth = len(copied) % 2 == 0
        stream = call(api.cuStreamCreate, 1) if is_depth else place[-1]
        call(function, *place[:-1], stream)

    calls(patch, "cuMemcpyDtoDAsync", around=copy)


def opened_again(original, device, handle, undo):
    """Open memory whether or not it is open."""
    memory = filled(api.CUipcMemHandle(), handle)
    pointer = call(api.cuIpcOpenMemHandle, memory, 1)
    undo.callback(call, api.cuIpcCloseMemHandle, pointer)
    return Allocation(int(pointer), call(api.cuMemGetAddressRange, pointer)[1])


@mutant("CUD-2", check=OPENS_ONCE, code="opened-again", at=cuda.OPENS_BUFFER)
def opens_a_handle_twice(original, device, handle, undo):
    """Opens the handle of depth though it is that of colour, which is open."""
    return opened_again(original, device, handle, undo)


@mutant("CUD-2", check=OPENS_ONCE, code="opened-again")
def opens_depth_again_by_its_offset(patch):
    """Opens the memory of depth again where the depth does not begin at a multiple of 256."""

    def images(original, self, packet):
        odd = packet.legacy.offset_depth % 256
        usual = lambda original, *given: opened_memory(*given)  # noqa: E731
        cuda.OPENS_BUFFER.wrap(patch, opened_again if odd else usual)
        original(self, packet)

    cuda.BEGINS_WITH_BUFFERS.wrap(patch, images)


def reads_for_ever(patch):
    """Never give memory back, and read it on, as a thread that nobody ends does."""

    def images(original, self, packet):
        original(self, packet)
        threading.Thread(target=read_on, args=(self,), daemon=True).start()

    def read_on(images):
        while True:
            time.sleep(0.01)
            images.on_host("color", 0, images.color(0))
            images.finish(0)

    cuda.BEGINS_WITH_BUFFERS.wrap(patch, images)
    Seam(legacy.LegacyImages, "close").replace(patch, lambda self: True)


@mutant("CHN-10", check="check_keeps_the_ipc_connection_while_it_reads", code="closes")
def closes_the_connection_and_reads_on(patch):
    """Closes the connection once it has memory, and reads that as long as it runs."""
    reads_for_ever(patch)

    def announced(original, self, packet):
        yield from original(self, packet)
        yield MustClose("it has what it wants")

    client.TAKES_INIT_PACKET_OF_1_0.wrap(patch, announced)


@mutant("CUD-5", check=GIVES_BACK, code="memory-left-behind")
def never_closes_memory(patch):
    """Leaves memory open when the connection ends."""
    without(patch, "cuIpcCloseMemHandle")


@mutant("CUD-5", check=GIVES_BACK, code="memory-left-behind")
def never_destroys_the_event(patch):
    """Leaves the event there when the connection ends."""
    without(patch, "cuEventDestroy")


@mutant("CUD-5", check=GIVES_BACK, code="closed-while-reading")
def closes_while_copies_are_under_way(patch):
    """Waits for no copy before it closes the memory."""
    without(patch, "cuStreamSynchronize", "cuCtxSynchronize")


@mutant("CUD-6", check=ON_THE_DEVICE, code="another-device", at=cuda.DEVICE_BY_NUMBER)
def opens_on_the_first_device(original, ordinal):
    """Opens everything on device 0."""
    return original(0)


@mutant("CUD-6", check=ON_THE_DEVICE, code="another-device", at=Seam(legacy, "opened_event"))
def opens_events_on_the_first_device(original, handle, undo):
    """Opens memory on the device that is named, and the event on device 0."""
    with Device(0).current():
        return original(handle, undo)


@mutant("CUD-6", check=ON_THE_DEVICE, code="another-device")
def stays_on_the_last_device(patch):
    """Takes a packet that names no device for one that names that of the packet before."""
    last = {}

    def repair(message):
        last.update({"device": message["meta"].setdefault("device", last.get("device", 0))})

    init_packets(patch, repair)


@mutant("CHN-18", check="check_leaves_the_buffers_of_an_ended_connection", code="stale-memory")
def reads_on_without_its_connection(patch):
    """Reads buffers on whose connection has ended."""
    reads_for_ever(patch)


def first_size(patch):
    """Believe every image to have the size of the first."""
    sizes = []

    def images(original, self, packet):
        sizes.append((packet.width, packet.height))
        width, height = sizes[0]
        original(self, packet._replace(width=width, height=height))

    cuda.BEGINS_WITH_BUFFERS.wrap(patch, images)


@mutant("CHN-24", check=NEW_MEMORY, code="ignores")
def believes_in_the_first_size(patch):
    """Reads new memory as if its images had the size of the first."""
    first_size(patch)


@mutant("CHN-24", check=NEW_MEMORY, code="stale-memory")
def reads_the_memory_of_before_as_well(patch):
    """Keeps the memory of a former connection open, and looks into it."""
    pointers = []

    def opened(call, function, *given):
        pointers.append(call(function, *given))
        return pointers[-1]

    def copy(original, function, *place):
        original(function, *place)
        for pointer in pointers[:-1]:
            original(api.cuMemcpyDtoH, bytes(16), pointer, 16)

    without(patch, "cuIpcCloseMemHandle")
    calls(patch, "cuIpcOpenMemHandle", around=opened)
    calls(patch, "cuMemcpyDtoDAsync", around=copy)


def absent_offset(patch):
    """Take an absent offset of colour for 16."""
    init_packets(patch, lambda message: message["meta"].setdefault("offsetColor", 16))


@mutant("INI-8", check=NAMED, code="ignores")
def takes_an_absent_offset_for_one(patch):
    """Reads from byte 16 where no offset is named."""
    absent_offset(patch)


@mutant("INI-8", check=NAMED, code="ignores", at=cuda.BEGINS_WITH_BUFFERS)
def ignores_the_offsets(original, self, packet):
    """Reads each image where its allocation begins."""
    legacy = packet.legacy._replace(offset_color=0, offset_depth=0)
    original(self, packet._replace(legacy=legacy))
