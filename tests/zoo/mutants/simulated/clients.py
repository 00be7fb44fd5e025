"""Mutants of the client: when it gives back what it was lent, and what it knows of connections."""

from splatbus_wire.messages import Frame

from tests.zoo.faults.seams import client
from tests.zoo.mutant import mutant


@mutant(check="nothing that a client holds is written", at=client.HANDS_OUT)
def releases_at_once(original, self):
    """Gives an image back when it begins to read it."""
    loan = original(self)
    if loan is not None and isinstance(loan.frame, Frame):
        loan.mapped.machine.release(loan.frame)
    return loan


@mutant(check="who can follow keeps its connections", at=client.SAYS_CLOSED)
def never_closes(original, self, generation):
    """Does not say that it has unmapped former memory."""
    self.retired.discard(generation)
    self.slots.pop(generation, None)


@mutant(check="what a server sends makes sense", at=client.ENDS_READING)
def reads_on_from_the_last(original, self):
    """Goes on with half a packet and the first bytes of the next connection."""
    former = self.machine
    original(self)
    begin = self.begin

    def begin_with_that():
        machine = begin()
        if former is not None:
            machine.reader.decoder.unfinished += former.reader.decoder.unfinished
        return machine

    self.begin = begin_with_that


@mutant(check="the newest pose outlives its connection", at=client.BEGINS_TO_STEER)
def forgets_poses(original, self):
    """Does not say on the next connection what it was told on the one before."""
    self.newest.clear()
    return original(self)
