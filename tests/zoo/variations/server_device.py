"""Allowed variations: servers whose images are in memory of a GPU."""

import threading

from splatbus_renderer.scene import default_scene
from splatbus_server.cuda.driver import api, call

from tests.zoo.faults import device as there
from tests.zoo.faults.driver import calls
from tests.zoo.faults.seams import server
from tests.zoo.mutant import together, variation
from tests.zoo.variations.server import server_turns_its_scene
from tests.zoo.variations.server_images import server_of_another_scene
from tests.zoo.variations.server_unhurried import drawing, showing

BLOCKING, NON_BLOCKING = 1, 1
NOTHING = threading.Event()


@variation()
def server_lends_from_a_device(patch):
    """Lends images in memory of a GPU, and stores those of 1.0 there."""


@variation()
def server_lends_nothing_from_a_device(patch):
    """Stores images of 1.0 in memory of a GPU, and lends none."""
    server.CAPABILITIES_ON_IPC.replace(patch, ())


@variation()
def server_copies_depth_first(patch):
    """Copies the depth first, when it has cleared the colour."""
    left = []

    def copy(original, self, place, plane):
        if plane.ndim == 3:
            call(api.cuMemsetD8Async, place, 0, plane.nbytes, self.stream)
            left[:] = [(place, plane)]
            return
        original(self, place, plane)
        while left:
            original(self, *left.pop())

    there.COPIES.wrap(patch, copy)


@variation(at=there.RECORDS)
def server_waits_and_records_elsewhere(original, self):
    """Waits for its copies, and records the event on a stream of its own."""
    call(api.cuStreamSynchronize, self.stream)
    self.stream, usual = call(api.cuStreamCreate, NON_BLOCKING), self.stream
    original(self)
    self.stream = usual


@variation()
def server_has_events_that_do_not_spin(patch):
    """Creates events by which the host waits without a processor."""
    calls(patch, "cuEventCreate", around=lambda call, create, flags: call(create, BLOCKING | flags))


@variation(at=there.PREPARES)
def server_of_1_0_is_empty_at_100(original, self, kernel, layout, slot, size, empty, *others):
    """Stores the depth 100 where nothing is seen in images of 1.0, as the deployed server does."""
    is_old = kernel == there.NUMBERED.legacy
    original(self, kernel, layout, slot, size, 100.0 if is_old else empty, *others)


@variation(at=server.GREETS_CLIENT)
def server_frees_what_it_has_shown_to_nobody(original, self, *given):
    """Makes memory for each client, and frees it unseen."""
    memory = self.exchange.memory
    memory.successor(memory.width, memory.height).close()
    return original(self, *given)


@together(
    server_lends_nothing_from_a_device,
    server_copies_depth_first,
    server_waits_and_records_elsewhere,
    server_has_events_that_do_not_spin,
    server_of_1_0_is_empty_at_100,
    server_frees_what_it_has_shown_to_nobody,
)
def server_of_1_0_on_a_device(patch):
    """Stores images of 1.0 in memory of a GPU in every way that CUDA allows, and lends none."""


@variation()
def server_copies_slowly_what_nobody_knows(patch):
    """Draws four images a second at most, of three spheres, and copies them at leisure."""

    def copy(original, self, *what):
        NOTHING.wait(0.05)
        original(self, *what)

    server_lends_nothing_from_a_device(patch)
    drawing(patch, 4.0)
    showing(patch, *default_scene().spheres[1:4])
    there.COPIES.wrap(patch, copy)


@variation()
def server_on_a_device_turns_what_nobody_knows(patch):
    """Turns a scene that nobody knows by itself, which tells nothing of poses."""
    server_lends_nothing_from_a_device(patch)
    server_of_another_scene(patch)
    server_turns_its_scene(patch)
