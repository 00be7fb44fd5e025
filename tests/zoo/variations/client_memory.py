"""Allowed variations: clients that take their time with memory, which no sentence limits."""

import time

from splatbus_client.lease import FrameLease

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, viewer
from tests.zoo.mutant import variation

LOADING_SECONDS = 4.0
PERIOD_SECONDS = 0.25


@variation(axes="opencv")
def loads_its_driver_with_the_first_memory(patch):
    """Takes 4 s to open the first memory that it is offered, and goes on as ever."""
    loaded: list[bool] = []

    def init(original, self, packet):
        if not loaded:
            loaded.append(True)
            time.sleep(LOADING_SECONDS)
        original(self, packet)

    client.BEGINS_WITH_MEMORY.wrap(patch, init)


@variation(axes="opencv")
def builds_its_shaders_with_the_first_frame(patch):
    """Takes 4 s until it has read the first frame, and gives it back then."""
    built: list[bool] = []

    def release(original, self):
        if not built:
            built.append(True)
            time.sleep(LOADING_SECONDS)
        original(self)

    Seam(FrameLease, "release").wrap(patch, release)


@variation(axes="opencv", at=viewer.READS_FRAME)
def looks_for_frames_at_4_hz(original, self, timeout):
    """Reads four frames a second at most."""
    time.sleep(PERIOD_SECONDS)
    original(self, timeout)
