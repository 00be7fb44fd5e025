"""Allowed variations in the life of the two channels."""

import itertools
import time
from collections.abc import Iterator
from typing import Any

from splatbus_client import channel, loop, reading
from splatbus_client.channel import Channel
from splatbus_client.loop import clock

from splatbus_conformance.selftest.mutants.client.channels import all_channels
from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.specimen import variation
from splatbus_conformance.selftest.surgery import wrap
from splatbus_conformance.selftest.variations.client import ends_with_its_server

THINKS_SECONDS = 1.5
LOADS_SECONDS = 4.0


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
    """Waits a second and a half before it says the first word on each connection."""
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


@variation(warns=("CHN-20",))
def loads_long_and_leaves(patch: Patch) -> None:
    """Loads what reads images for four seconds when it first opens some; ends with its server."""
    loaded: list[bool] = []

    def opened(original: Any, *arguments: Any) -> Any:
        if not loaded:
            loaded.append(True)
            time.sleep(LOADS_SECONDS)
        return original(*arguments)

    wrap(patch, reading, "_opened", opened)
    ends_with_its_server(patch)


@variation()
def pauses_twice_as_long_each_time(patch: Patch) -> None:
    """Connects again after 0.25 seconds, and waits twice as long after each further loss, whatever
    came between, up to 4 seconds.
    """
    failures = itertools.count()
    patch.setattr(channel, "delays", lambda: _doubling(failures))


def _doubling(failures: Iterator[int]) -> Iterator[float]:
    return (min(0.25 * 2**n, 4.0) for n in failures)


@variation()
def looks_four_times_a_second(patch: Patch) -> None:
    """Does all that it does on its channels in one of four turns a second, as a renderer does."""

    def run(original: Any, self: Any, timeout: float | None = None) -> Any:
        time.sleep(0.25 - clock() % 0.25)
        return original(self, 0.0)

    wrap(patch, loop._Selector, "select", run)
