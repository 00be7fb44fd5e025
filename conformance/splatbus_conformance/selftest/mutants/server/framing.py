"""Mutants that break FRM: they misread packets, or write them wrongly."""

from typing import Any

import pytest
from splatbus_server.connection import Connection
from splatbus_wire.errors import FramingError

from splatbus_conformance.selftest.specimen import mutant
from splatbus_conformance.selftest.surgery import wrap


@mutant("FRM-3", check="check_bad_length_closes", reason="neither reacted nor went on")
def server_waits_on_after_a_bad_length(patch: pytest.MonkeyPatch) -> None:
    """Reads nothing more after a bad header, and keeps the connection."""

    def next_event(original: Any, self: Connection, now: float) -> Any:
        ending = self.ending
        event = original(self, now)
        try:
            self._decoder.next_packet()
        except FramingError:
            self.ending = ending
            return None
        return event

    wrap(patch, Connection, "next_event", next_event)


@mutant("FRM-4", check="check_any_segmentation", reason="were not answered")
def server_takes_each_read_for_a_packet(patch: pytest.MonkeyPatch) -> None:
    """Takes what one read returns for whole packets, and drops what is left over."""

    def receive(original: Any, self: Connection, data: bytes, now: float) -> Any:
        given = original(self, data, now)
        self._decoder._unfinished.clear()
        return given

    wrap(patch, Connection, "receive", receive)
