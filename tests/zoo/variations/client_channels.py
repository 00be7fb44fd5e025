"""Allowed variations in the life of the two channels."""

from tests.zoo.faults.seams import client
from tests.zoo.mutant import variation
from tests.zoo.mutants.v1_0.chn.clients import all_channels


@variation()
def one_channel_after_the_other(patch):
    """Tries the IPC channel until it is connected, and only then the message channel."""
    made = all_channels(patch)

    def connect(original, self, now):
        if self is not made[0] and made[0].machine is None:
            self.due = now + 0.05
            return
        original(self, now)

    client.CONNECTS.wrap(patch, connect)


@variation(at=client.LOSES_CONNECTION)
def comes_back_late(original, self, reason, now):
    """Connects again 8 seconds after each connection that it lost."""
    original(self, reason, now)
    self.due = now + 8.0
