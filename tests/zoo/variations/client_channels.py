"""Allowed variations in the life of the two channels."""

from typing import Any

from splatbus_client.channel import Channel

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seams import client
from tests.zoo.mutant import variation
from tests.zoo.mutants.v1_0.chn.clients import all_channels


@variation()
def one_channel_after_the_other(patch: Patch) -> None:
    """Tries the IPC channel until it is connected, and only then the message channel."""
    made = all_channels(patch)

    def connect(original: Any, self: Channel, now: float) -> None:
        if self is not made[0] and made[0].machine is None:
            self.due = now + 0.05
            return
        original(self, now)

    client.CONNECTS.wrap(patch, connect)


@variation()
def comes_back_late(patch: Patch) -> None:
    """Connects again 8 seconds after each connection that it lost."""

    def lose(original: Any, self: Channel, reason: str, now: float) -> None:
        original(self, reason, now)
        self.due = now + 8.0

    client.LOSES_CONNECTION.wrap(patch, lose)
