"""Allowed variations in the life of the two channels."""

from typing import Any

from splatbus_client.channel import Channel
from splatbus_client.loop import clock

from splatbus_conformance.selftest.mutants.client.channels import all_channels
from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.specimen import variation
from splatbus_conformance.selftest.surgery import wrap

THINKS_SECONDS = 1.2


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
def thinks_before_each_hello(patch: Patch) -> None:
    """Waits more than a second before it says the first word on each connection."""
    said_from: dict[object, float] = {}

    def flush(original: Any, self: Channel, now: float) -> None:
        if self._machine is None:
            return
        if now >= said_from.setdefault(self._machine, self._connected_at + THINKS_SECONDS):
            original(self, now)

    def advance(original: Any, self: Channel, now: float) -> None:
        original(self, now)
        self.flush(now)

    def deadline(original: Any, self: Channel) -> float | None:
        due: float | None = original(self)
        first = said_from.get(self._machine, 0.0)
        return due if clock() >= first else first if due is None else min(due, first)

    wrap(patch, Channel, "flush", flush)
    wrap(patch, Channel, "advance", advance)
    wrap(patch, Channel, "deadline", deadline)
