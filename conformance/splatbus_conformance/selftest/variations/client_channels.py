"""Allowed variations in the life of the two channels."""

from socket import SO_ERROR, SOL_SOCKET
from typing import Any

from splatbus_client.channel import Channel

from splatbus_conformance.selftest.mutants.client.channels import all_channels
from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.specimen import variation
from splatbus_conformance.selftest.surgery import wrap


@variation()
def one_channel_after_the_other(patch: Patch) -> None:
    """Tries the IPC channel until it is connected, and only then the message channel."""
    made = all_channels(patch)

    def connect(original: Any, self: Channel, now: float) -> None:
        if self is not made[0] and made[0]._machine is None:
            self._due = now + 0.05
            return
        original(self, now)

    wrap(patch, Channel, "_connect", connect)


@variation()
def looks_before_it_connects(patch: Patch) -> None:
    """Opens a connection to see whether the server is there, closes it, and opens the real one an
    eighth of a second later: at its start, and whenever it comes back.
    """
    looked: set[Channel] = set()

    def finish(original: Any, self: Channel, now: float) -> None:
        assert self.socket is not None
        if self in looked or self.socket.getsockopt(SOL_SOCKET, SO_ERROR):
            looked.discard(self)
            original(self, now)
            return
        looked.add(self)
        self.socket.close()
        self.socket, self._due = None, now + 0.125

    wrap(patch, Channel, "_finish_connecting", finish)
