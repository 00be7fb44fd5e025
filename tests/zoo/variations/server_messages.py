"""Allowed variations: servers that do less, or more, of what a message channel of 1.1 can carry."""

import time
from contextlib import suppress

import numpy as np
from splatbus_conformance.wire.packets import CROWD_BYTES
from splatbus_server import api
from splatbus_server.api import Bus
from splatbus_server.control import Poses
from splatbus_server.viewport import Change
from splatbus_wire.messages import SceneObject

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import variation
from tests.zoo.variations.server_images import serving


def grants(patch, *capabilities):
    """Have these capabilities of the message channel and no others.

    A scene that is not told is the one of `conformance/SCENE.md` with all in one object.
    """
    server.CAPABILITIES_OF_MESSAGES.replace(patch, capabilities)
    if "scene" not in capabilities:
        serving(patch, objects=api.ONE_OBJECT)


@variation()
def server_without_message_capabilities(patch):
    """Lends images, and speaks 1.0 with `hello` on the message channel."""
    grants(patch)


@variation()
def server_of_objects_alone(patch):
    """Has `objects` and no other capability: nobody can ask for their names."""
    grants(patch, "objects")


@variation()
def server_of_lenses_and_pings(patch):
    """Has `intrinsics` and `ping`."""
    grants(patch, "intrinsics", "ping")


@variation()
def server_of_telemetry_and_sizes(patch):
    """Has `telemetry` and `viewport`."""
    grants(patch, "telemetry", "viewport")


@variation(at=server.MAKES_SUCCESSOR)
def server_has_no_other_size(original, self, width, height):
    """Answers `unsupported` to everybody who asks for another size."""
    raise OSError("images have the size that they have")


@variation(at=Seam(Change, "allocate"))
def server_takes_its_time_for_a_size(original, self):
    """Takes 200 ms to have memory of another size."""
    time.sleep(0.2)
    original(self)


@variation()
def server_lists_every_object(patch):
    """Lists objects that are at rest in each frame, too."""
    Seam(Poses, "moved_objects").replace(patch, property(lambda self: tuple(self.objects.values())))


@variation()
def server_of_many_objects(patch):
    """Has forty objects, of which one is seen, with names of any kind."""
    names = ("default", "chair", "a/b~c", "\\\"'", "🙂" * 64, *(f"object {n}" for n in range(35)))
    serving(patch, objects=[SceneObject(name, "", 0) for name in names])


@variation()
def server_tells_lenses_in_single_precision(patch):
    """Rounds the numbers of its cameras to single precision."""

    def single(frame):
        camera = frame["camera"]
        rounded = {n: float(np.float32(camera[n])) for n in ("fx", "fy", "cx", "cy", "near", "far")}
        return frame | {"camera": camera | rounded}

    messages(patch, of_type("frame", single))


@variation()
def server_has_nothing_to_tell(patch):
    """Has `telemetry`, and no series."""
    Seam(Bus, "telemetry").wrap(patch, lambda original, self, *values, **named: None)


@variation(at=server.FLUSHES)
def server_is_cut_behind_a_header(original, self, peer, now):
    """Writes many packets at once, which TCP divides behind a header."""
    unsent = peer.connection.unsent
    ends = [0]
    while ends[-1] < len(unsent) and ends[-1] <= CROWD_BYTES:
        ends.append(ends[-1] + 4 + int.from_bytes(unsent[ends[-1] : ends[-1] + 4], "little"))
    if CROWD_BYTES < ends[-1] < len(unsent):
        with suppress(OSError):
            del unsent[: peer.socket.send(unsent[: ends[-1] + 4])]
            time.sleep(0.002)
    original(self, peer, now)
