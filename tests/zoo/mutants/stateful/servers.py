"""Mutants that one scenario does not find: what is wrong follows from what was before."""

from typing import Any

from splatbus_server.connection import Connection
from splatbus_server.ring import Ring
from splatbus_wire.messages import GetCameraPose, GetViewportSize

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant


@mutant("CHN-14", check="check_serves_all_in_any_session", code="no-reply")
def server_turns_from_the_first_as_others_leave(patch):
    """Answers whoever moves the camera no more once two have left that would have moved it."""
    left: list[Any] = []

    def leave(original, self, connection):
        if next(iter(self.sent), None) is connection:
            left.clear()
        elif connection in self.sent:
            left.append(connection)
        given: bool = original(self, connection)
        return given

    def handle(original, self, connection, *arguments):
        first = next(iter(self.control.sent), None)
        if len(left) > 1 and connection is first and isinstance(arguments[0], GetViewportSize):
            return None
        return original(self, connection, *arguments)

    server.PASSES_CONTROL_ON.wrap(patch, leave)
    server.HANDLES_MESSAGE.wrap(patch, handle)


@mutant(
    "REQ-7",
    check="check_answers_in_order_in_any_session",
    code="unasked-reply",
)
def server_mixes_up_replies_after_a_loss(patch):
    """Sends replies to the connection whose place is one further, once an earlier one has gone."""
    seats: list[Connection] = []
    gone: list[Connection] = []

    def handle(original, self, connection, *arguments):
        if isinstance(arguments[0], GetViewportSize | GetCameraPose):
            if connection not in seats:
                seats.append(connection)
            place = seats.index(connection) + len(gone)
            connection = seats[min(place, len(seats) - 1)]
        return original(self, connection, *arguments)

    def leave(original, self, connection):
        if connection in seats:
            if connection is not seats[-1]:
                gone.append(connection)
            seats.remove(connection)
        if not seats:
            gone.clear()
        original(self, connection)

    server.HANDLES_MESSAGE.wrap(patch, handle)
    server.FORGETS_CLIENT.wrap(patch, leave)


@mutant("POS-11", check="check_obeys_the_first_in_any_session", code="pose-not-shown")
def server_leaves_control_with_the_dead(patch):
    """Passes control on when the first closes, but not when the next one does."""
    passed: list[bool] = []

    def leave(original, self, connection):
        has_control = next(iter(self.sent), None) is connection
        if has_control and passed and len(self.sent) > 1:
            return False
        given: bool = original(self, connection)
        if has_control and self.sent:
            passed.append(True)
        elif not self.sent:
            passed.clear()
        return given

    server.PASSES_CONTROL_ON.wrap(patch, leave)


@mutant(
    "IMG-2",
    check="check_lends_one_at_a_time_in_any_session",
    code="another-frame",
    at=server.TAKES_SUBSCRIPTION,
)
def server_forgets_the_lease_when_subscribed(original, self, connection, channels):
    """Takes `subscribe` for a `release`, from a client that held an image as it moved on."""
    given = original(self, connection, channels)
    reader = self.readers.get(connection)
    if reader is not None and reader.lease is not None:
        newest = self.exchange.newest
        if newest is not None and newest.seq > reader.lease.seq + 1:
            self.exchange.take_back(connection, reader.lease)
            reader.lease = None
    return given


@mutant(
    "IMG-17",
    check="check_takes_leases_back_in_any_session",
    code="leases-not-taken-back",
    at=Seam(Ring, "drop"),
)
def server_leaks_leases_of_old_images(original, self, client):
    """Keeps the lease of a client that leaves with an image that is the newest no more."""
    held = self.held.get(client)
    if held is None or held == self.newest:
        original(self, client)
