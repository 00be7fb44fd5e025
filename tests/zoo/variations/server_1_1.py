"""Allowed variations: servers that negotiate, announce and lend in unusual ways, and conform."""

import itertools
import os
import secrets
from functools import partial

from splatbus_server import api, ring, shared_memory
from splatbus_server import connection as connections
from splatbus_server.connection import Refusal
from splatbus_server.exchange import BOTH, Exchange
from splatbus_wire.init_packet import Slots
from splatbus_wire.messages import CameraPose

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer, server
from tests.zoo.faults.surgery import OF_THIS_RUN, messages, of_type
from tests.zoo.mutant import variation
from tests.zoo.mutants.v1_1.ctl import unsaid
from tests.zoo.mutants.v1_1.neg.servers import (
    announces_cuda_memory,
    at_once,
)

NEEDLESS = (
    *("malformed_packet", "packet_too_large", "malformed_json", "not_an_object"),
    "unknown_type",
)


def has(patch, *capabilities):
    """Have these capabilities and no others."""
    server.CAPABILITIES_ON_IPC.replace(patch, capabilities)


@variation()
def server_has_no_capability(patch):
    """Says hello back, and has no images for anybody."""
    has(patch)
    server.CAPABILITIES_OF_MESSAGES.replace(patch, ())


@variation()
def server_speaks_1_1_alone(patch):
    """Refuses clients that say hello for 1.0."""
    Seam(connections, "VERSIONS").replace(patch, ("1.1",))


@variation()
def server_announces_cuda_memory(patch):
    """Has its images in memory of a device, and says so to everybody at once."""
    at_once(patch, announces_cuda_memory(patch))


@variation()
def server_reports_nothing_that_it_need_not(patch):
    """Ignores what is broken without a word, but for requests."""

    unsaid(patch, *NEEDLESS)


@variation()
def server_reports_little(patch):
    """Writes errors without text or explanation, and with a pointer where it has to be."""

    def bare(error):
        kept = ["type", "code", "id", "supported"]
        if error.get("pointer") in ("/intrinsics", "/object"):
            kept.append("pointer")
        return {name: error[name] for name in kept if name in error} | {"message": ""}

    messages(patch, of_type("error", bare))


@variation(warns=("EVO-4",))
def server_grants_in_another_order(patch):
    """Lists capabilities backwards, and says more of itself in welcome than anybody asks."""

    def change(welcome):
        server = {"name": "", "version": "\U0001f642" * 64, "licence": None}
        granted = list(reversed(welcome["capabilities"]))
        return welcome | {"capabilities": granted, "server": server, "motto": ["we", {}]}

    messages(patch, of_type("welcome", change))


@variation()
def server_counts_otherwise(patch):
    """Begins with a large generation, and leaves numbers of images out."""
    further = itertools.count(2**53 - 65)

    def init(original, self, *arguments, **named):
        original(self, *arguments, **named)
        self.generation = generation = next(further)
        self.init_packet = self.init_packet._replace(generation=generation)

    def publish(original, self, slot):
        self.last_seq += 1000
        number: int = original(self, slot)
        return number

    server.ALLOCATES.wrap(patch, init)
    Seam(ring.Ring, "publish").wrap(patch, publish)


@variation(at=server.LAYS_OUT_RING)
def server_alternates_colour_and_depth(original, width, height, slots):
    """Puts the depth of each slot behind its colour."""
    usual, _ = original(width, height, slots)
    stride = usual.color_stride + usual.depth_stride
    return Slots(slots, 0, stride, usual.color_stride, stride), slots * stride


@variation()
def server_has_one_name_for_its_memory(patch):
    """Counts its memory, and removes what has that name; others do the same on their ports."""

    def create(original, size, *_):
        name = f"{port}-{next(count)}"
        Seam(secrets, "token_hex").replace(patch, lambda length: name)
        (shared_memory.DIRECTORY / f"{OF_THIS_RUN}{name}").unlink(missing_ok=True)
        return original(size, OF_THIS_RUN)

    port, count = os.environ.get("SPLATBUS_IPC_PORT", "0"), itertools.count(1)
    server.CREATES_SEGMENT.wrap(patch, create)


@variation()
def server_lends_to_many_readers(patch):
    """Has slots for more readers than it takes connections."""
    renderer.SERVES.replace(patch, partial(api.serve, readers=20))


@variation()
def server_republishes_for_each_reader(patch):
    """Renders anew whenever somebody opens the ring or subscribes."""

    def again(original, self, *arguments):
        self.exchange.shown = None
        return original(self, *arguments)

    server.TAKES_SUBSCRIPTION.wrap(patch, again)
    server.HEARS_OF_MEMORY.wrap(patch, again)


@variation(warns=("IMG-21",))
def server_writes_colour_and_depth_always(patch):
    """Writes both, whatever readers want."""
    Seam(Exchange, "want").wrap(patch, lambda original, self, c, m: original(self, c and BOTH, m))


@variation(at=server.TAKES_POSE)
def server_leaves_out_a_lens_that_was_not_granted(original, self, connection, message):
    """Takes a pose whose lens was not granted without that."""
    if isinstance(message, CameraPose) and not connection.has("intrinsics"):
        message = message._replace(intrinsics=None)
    return original(self, connection, message)


@variation(at=server.GREETS)
def server_ignores_a_second_hello(original, self, hello, now):
    """Does nothing when a client says hello again."""
    if self.welcome is not None:
        return Refusal("invalid_message", "hello was said before")
    return original(self, hello, now)
