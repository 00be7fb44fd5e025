"""Mutants that break IMG: what they make of leases."""

import time

from splatbus_wire.messages import Release

from tests.zoo.faults.seams import renderer, server
from tests.zoo.mutant import mutant

SLOW_SECONDS = 0.5
REFUSES = "check_refuses_readers_that_it_has_no_slot_for"


@mutant("IMG-9", check="check_waits_for_no_reader", code="no-frame", at=server.PUBLISHES)
def server_publishes_when_nobody_reads(original, self, *arguments):
    """Publishes when nobody holds an image."""
    while self.memory.ring.held:
        time.sleep(0.002)
    return original(self, *arguments)


IGNORES = "check_ignores_release_of_what_is_not_held"


@mutant("IMG-16", check=IGNORES, code="another-frame", at=server.TAKES_IMAGE_BACK)
def server_takes_any_release(original, self, connection, message):
    """Ends the lease at any release, whatever it names."""
    lease = self.readers[connection].lease
    named = message if lease is None else Release(lease.memory.generation, lease.seq)
    return original(self, connection, named)


@mutant("IMG-16", check=IGNORES, code="closes", at=server.TAKES_IMAGE_BACK)
def server_closes_at_a_wrong_release(original, self, connection, message):
    """Ends a connection that releases what it does not hold."""
    refusal = original(self, connection, message)
    if refusal is not None:
        connection.end("that is not held", time.monotonic())
    return refusal


@mutant("IMG-17", check="check_ends_leases_with_the_connection", code="no-frame")
def server_keeps_the_leases_of_the_dead(patch):
    """Waits for the release of an image although the connection that holds it has ended."""
    server.ENDS_LEASES.wrap(patch, lambda original, *arguments: None)
    _lends_to_any_number(patch)


def _lends_to_any_number(patch):
    """Count no readers, and render nothing while every slot is lent."""

    def lease(original, self, client):
        self.clients = 1000
        return original(self, client)

    def begin_write(original, self):
        try:
            return original(self)
        except StopIteration:
            return None

    def next_view(original, self, *arguments):
        with self.changed:
            slot = self.memory.ring.begin_write()
        if slot is not None:
            return original(self, *arguments)
        time.sleep(0.01)
        return None

    server.LEASES_SLOT.wrap(patch, lease)
    server.CHOOSES_SLOT.wrap(patch, begin_write)
    server.NEXT_VIEW.wrap(patch, next_view)


@mutant("IMG-18", check=REFUSES, code="no-error", at=server.COMPLAINS)
def server_does_not_say_that_it_is_full(original, self, refusal):
    """Closes the connection of a reader that is too many without a word."""
    return refusal if refusal.code == "too_many_clients" else original(self, refusal)


@mutant("IMG-18", check=REFUSES, code="waits", at=server.ENDS_CONNECTION)
def server_lets_readers_queue(original, self, reason, now):
    """Says that it is full, and keeps the connection until somebody leaves."""
    if "[IMG-18]" not in reason:
        original(self, reason, now)


@mutant("IMG-18", check=REFUSES, code="no-frame")
def server_takes_more_readers_than_slots(patch):
    """Makes a ring for four readers, and takes whoever comes."""

    def greet(original, self, connection, now):
        self.exchange.memory.ring.clients = 1000
        return original(self, connection, now)

    server.GREETS_CLIENT.wrap(patch, greet)
    _lends_to_any_number(patch)


@mutant(
    "IMG-4",
    check="check_what_two_hold_is_not_written",
    code="written-while-held",
    at=server.CHOOSES_SLOT,
)
def server_keeps_the_newest_lease_alone(original, self):
    """Of images that several readers hold, keeps the one that was lent last."""
    held = dict(self.held)
    self.held = dict(list(held.items())[-1:])
    slot: int = original(self)
    self.held = held
    return slot


@mutant("IMG-16", check=IGNORES, code="another-frame")
def server_takes_any_release_and_draws_slowly(patch):
    """Ends the lease at any release, and takes half a second for an image."""
    server_takes_any_release.specimens[0].alter(patch)

    def render(original, *arguments):
        time.sleep(SLOW_SECONDS)
        return original(*arguments)

    renderer.RENDERS_IMAGE.wrap(patch, render)
