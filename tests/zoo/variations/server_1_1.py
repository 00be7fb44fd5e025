"""Allowed variations: servers that negotiate, announce and lend in unusual ways, and conform."""

import itertools
import os
import secrets
from functools import partial
from typing import Any

from splatbus_server import api, ring, shared_memory
from splatbus_server import connection as connections
from splatbus_server.connection import Connection, Refusal
from splatbus_server.exchange import BOTH, Exchange
from splatbus_server.memory import Memory
from splatbus_server.session import Session
from splatbus_wire.init_packet import Slots
from splatbus_wire.messages import CameraPose, Hello

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer, server
from tests.zoo.faults.surgery import Json, messages, of_type
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


def has(patch: Patch, *capabilities: str) -> None:
    """Have these capabilities and no others."""
    server.CAPABILITIES_ON_IPC.replace(patch, capabilities)


@variation()
def server_has_no_capability(patch: Patch) -> None:
    """Says hello back, and has no images for anybody."""
    has(patch)
    server.CAPABILITIES_OF_MESSAGES.replace(patch, ())


@variation()
def server_speaks_1_1_alone(patch: Patch) -> None:
    """Refuses clients that say hello for 1.0."""
    Seam(connections, "VERSIONS").replace(patch, ("1.1",))


@variation()
def server_announces_cuda_memory(patch: Patch) -> None:
    """Has its images in memory of a device, and says so to everybody at once."""
    at_once(patch, announces_cuda_memory(patch))


@variation()
def server_reports_nothing_that_it_need_not(patch: Patch) -> None:
    """Ignores what is broken without a word, but for requests."""

    unsaid(patch, *NEEDLESS)


@variation()
def server_reports_little(patch: Patch) -> None:
    """Writes errors without text or explanation, and with a pointer where it has to be."""

    def bare(error: Json) -> Json:
        kept = ["type", "code", "id", "supported"]
        if error.get("pointer") in ("/intrinsics", "/object"):
            kept.append("pointer")
        return {name: error[name] for name in kept if name in error} | {"message": ""}

    messages(patch, of_type("error", bare))


@variation(warns=("EVO-4",))
def server_grants_in_another_order(patch: Patch) -> None:
    """Lists capabilities backwards, and says more of itself in welcome than anybody asks."""

    def change(welcome: Json) -> Json:
        server = {"name": "", "version": "\U0001f642" * 64, "licence": None}
        granted = list(reversed(welcome["capabilities"]))
        return welcome | {"capabilities": granted, "server": server, "motto": ["we", {}]}

    messages(patch, of_type("welcome", change))


@variation()
def server_counts_otherwise(patch: Patch) -> None:
    """Begins with a large generation, and leaves numbers of images out."""
    further = itertools.count(2**53 - 65)

    def init(original: Any, self: Memory, *arguments: Any, **named: Any) -> None:
        original(self, *arguments, **named)
        self.generation = generation = next(further)
        self.init_packet = self.init_packet._replace(generation=generation)

    def publish(original: Any, self: ring.Ring, slot: int) -> int:
        self.last_seq += 1000
        number: int = original(self, slot)
        return number

    server.ALLOCATES.wrap(patch, init)
    Seam(ring.Ring, "publish").wrap(patch, publish)


@variation()
def server_alternates_colour_and_depth(patch: Patch) -> None:
    """Puts the depth of each slot behind its colour."""

    def host_ring(original: Any, width: int, height: int, slots: int) -> tuple[Slots, int]:
        usual, _ = original(width, height, slots)
        stride = usual.color_stride + usual.depth_stride
        return Slots(slots, 0, stride, usual.color_stride, stride), slots * stride

    server.LAYS_OUT_RING.wrap(patch, host_ring)


@variation()
def server_has_one_name_for_its_memory(patch: Patch) -> None:
    """Counts its memory, and removes what has that name; others do the same on their ports."""

    def create(original: Any, size: int, *_: str) -> Any:
        name = f"{port}-{next(count)}"
        Seam(secrets, "token_hex").replace(patch, lambda length: name)
        (shared_memory.DIRECTORY / f"splatbus-own-{name}").unlink(missing_ok=True)
        return original(size, "splatbus-own-")

    port, count = os.environ.get("SPLATBUS_IPC_PORT", "0"), itertools.count(1)
    server.CREATES_SEGMENT.wrap(patch, create)


@variation()
def server_lends_to_many_readers(patch: Patch) -> None:
    """Has slots for more readers than it takes connections."""
    renderer.SERVES.replace(patch, partial(api.serve, readers=20))


@variation()
def server_republishes_for_each_reader(patch: Patch) -> None:
    """Renders anew whenever somebody opens the ring or subscribes."""

    def again(original: Any, self: Session, *arguments: Any) -> Any:
        self.exchange.shown = None
        return original(self, *arguments)

    server.TAKES_SUBSCRIPTION.wrap(patch, again)
    server.HEARS_OF_MEMORY.wrap(patch, again)


@variation(warns=("IMG-21",))
def server_writes_colour_and_depth_always(patch: Patch) -> None:
    """Writes both, whatever readers want."""
    Seam(Exchange, "want").wrap(patch, lambda original, self, c, m: original(self, c and BOTH, m))


@variation()
def server_leaves_out_a_lens_that_was_not_granted(patch: Patch) -> None:
    """Takes a pose whose lens was not granted without that."""

    def move(original: Any, self: Session, connection: Connection, message: Any) -> Any:
        if isinstance(message, CameraPose) and not connection.has("intrinsics"):
            message = message._replace(intrinsics=None)
        return original(self, connection, message)

    server.TAKES_POSE.wrap(patch, move)


@variation()
def server_ignores_a_second_hello(patch: Patch) -> None:
    """Does nothing when a client says hello again."""

    def greet(original: Any, self: Connection, hello: Hello, now: float) -> Any:
        if self.welcome is not None:
            return Refusal("invalid_message", "hello was said before")
        return original(self, hello, now)

    server.GREETS.wrap(patch, greet)
