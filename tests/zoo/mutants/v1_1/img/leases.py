"""Mutants that break IMG: what they make of leases."""

import time
from typing import Any

from splatbus_server.connection import Connection
from splatbus_server.exchange import Exchange
from splatbus_server.ring import Ring
from splatbus_server.session import Session
from splatbus_wire.messages import Release

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer, server
from tests.zoo.mutant import mutant

SLOW_SECONDS = 0.5
REFUSES = "check_refuses_readers_that_it_has_no_slot_for"


@mutant("IMG-9", check="check_waits_for_no_reader", code="no-frame")
def server_publishes_when_nobody_reads(patch: Patch) -> None:
    """Publishes when nobody holds an image."""

    def publish(original: Any, self: Exchange, *arguments: Any) -> Any:
        while self.memory.ring.held:
            time.sleep(0.002)
        return original(self, *arguments)

    server.PUBLISHES.wrap(patch, publish)


IGNORES = "check_ignores_release_of_what_is_not_held"


@mutant("IMG-16", check=IGNORES, code="another-frame")
def server_takes_any_release(patch: Patch) -> None:
    """Ends the lease at any release, whatever it names."""

    def release(original: Any, self: Session, connection: Connection, message: Release) -> Any:
        lease = self.readers[connection].lease
        named = message if lease is None else Release(lease.memory.generation, lease.seq)
        return original(self, connection, named)

    server.TAKES_IMAGE_BACK.wrap(patch, release)


@mutant("IMG-16", check=IGNORES, code="closes")
def server_closes_at_a_wrong_release(patch: Patch) -> None:
    """Ends a connection that releases what it does not hold."""

    def release(original: Any, self: Session, connection: Connection, message: Release) -> Any:
        refusal = original(self, connection, message)
        if refusal is not None:
            connection.end("that is not held", time.monotonic())
        return refusal

    server.TAKES_IMAGE_BACK.wrap(patch, release)


@mutant("IMG-17", check="check_ends_leases_with_the_connection", code="no-frame")
def server_keeps_the_leases_of_the_dead(patch: Patch) -> None:
    """Waits for the release of an image although the connection that holds it has ended."""
    Seam(Exchange, "forget").wrap(patch, lambda original, *arguments: None)
    _lends_to_any_number(patch)


def _lends_to_any_number(patch: Patch) -> None:
    """Count no readers, and render nothing while every slot is lent."""

    def lease(original: Any, self: Ring, client: Any) -> Any:
        self.clients = 1000
        return original(self, client)

    def begin_write(original: Any, self: Ring) -> Any:
        try:
            return original(self)
        except StopIteration:
            return None

    def next_view(original: Any, self: Exchange, *arguments: Any) -> Any:
        with self.changed:
            slot = self.memory.ring.begin_write()
        if slot is not None:
            return original(self, *arguments)
        time.sleep(0.01)
        return None

    Seam(Ring, "lease").wrap(patch, lease)
    server.CHOOSES_SLOT.wrap(patch, begin_write)
    server.NEXT_VIEW.wrap(patch, next_view)


@mutant("IMG-18", check=REFUSES, code="no-error")
def server_does_not_say_that_it_is_full(patch: Patch) -> None:
    """Closes the connection of a reader that is too many without a word."""

    def complain(original: Any, self: Connection, refusal: Any) -> Any:
        return refusal if refusal.code == "too_many_clients" else original(self, refusal)

    server.COMPLAINS.wrap(patch, complain)


@mutant("IMG-18", check=REFUSES, code="waits")
def server_lets_readers_queue(patch: Patch) -> None:
    """Says that it is full, and keeps the connection until somebody leaves."""

    def end(original: Any, self: Connection, reason: str, now: float) -> None:
        if "[IMG-18]" not in reason:
            original(self, reason, now)

    server.ENDS_CONNECTION.wrap(patch, end)


@mutant("IMG-18", check=REFUSES, code="no-frame")
def server_takes_more_readers_than_slots(patch: Patch) -> None:
    """Makes a ring for four readers, and takes whoever comes."""

    def init(original: Any, self: Session, exchange: Any, cameras: Any, *more: Any) -> None:
        original(self, exchange, cameras, 1000, *more[1:])

    Seam(Session, "__init__").wrap(patch, init)
    _lends_to_any_number(patch)


@mutant("IMG-4", check="check_what_two_hold_is_not_written", code="written-while-held")
def server_keeps_the_newest_lease_alone(patch: Patch) -> None:
    """Of images that several readers hold, keeps the one that was lent last."""

    def begin_write(original: Any, self: Ring) -> int:
        held = dict(self.held)
        self.held = dict(list(held.items())[-1:])
        slot: int = original(self)
        self.held = held
        return slot

    server.CHOOSES_SLOT.wrap(patch, begin_write)


@mutant("IMG-16", check=IGNORES, code="another-frame")
def server_takes_any_release_and_draws_slowly(patch: Patch) -> None:
    """Ends the lease at any release, and takes half a second for an image."""
    server_takes_any_release(patch)

    def render(original: Any, *arguments: Any) -> Any:
        time.sleep(SLOW_SECONDS)
        return original(*arguments)

    renderer.RENDERS_IMAGE.wrap(patch, render)
