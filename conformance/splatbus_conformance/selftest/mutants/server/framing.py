"""Mutants that break FRM: they misread packets, or write them wrongly."""

import time
from typing import Any

from splatbus_server.connection import Connection
from splatbus_server.service import Peer, Service
from splatbus_wire.errors import FramingError

from splatbus_conformance.selftest.mutants.server.text import trusts_its_scene
from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.specimen import mutant
from splatbus_conformance.selftest.surgery import packets, wrap


@mutant("FRM-1", reason="bytes into a packet", through="FRM-3")
def server_ends_within_a_packet(patch: Patch) -> None:
    """Begins one more packet when it ends a connection."""

    def end(original: Any, self: Connection, reason: str, now: float) -> None:
        if self.ending is None:
            self.unsent += b"\x1c\x00\x00\x00{"
        original(self, reason, now)

    wrap(patch, Connection, "end", end)


@mutant("FRM-2", reason="announces 0 bytes")
def server_sends_empty_packets(patch: Patch) -> None:
    """Sends an empty packet behind every message."""
    trusts_its_scene(patch)
    packets(patch, lambda packet: packet + bytes(4))


@mutant("FRM-3", check="check_bad_length_closes", reason="neither reacted nor went on")
def server_waits_on_after_a_bad_length(patch: Patch) -> None:
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
def server_takes_each_read_for_a_packet(patch: Patch) -> None:
    """Takes what one read returns for whole packets, and drops what is left over."""
    _forget_what_is_left_over(patch, "message")


@mutant("FRM-4", check="check_any_segmentation_on_ipc", reason="has no welcome")
def server_takes_each_read_for_a_packet_on_ipc(patch: Patch) -> None:
    """The same on the IPC channel."""
    _forget_what_is_left_over(patch, "ipc")


@mutant("FRM-5", check="check_incomplete_packet_is_given_up", reason="stays incomplete")
def server_waits_forever_for_a_packet(patch: Patch) -> None:
    """Sets no limit to the time that a packet takes."""

    def receive(original: Any, self: Connection, data: bytes, now: float) -> None:
        original(self, data, now + 3600)

    wrap(patch, Connection, "receive", receive)


@mutant(
    "FRM-6", check="check_half_packet_is_discarded", reason="of a request, and then another one"
)
def server_goes_on_with_half_a_packet(patch: Patch) -> None:
    """Continues the packet of one connection with the bytes of the next."""
    left: dict[str, bytes] = {}

    def init(original: Any, self: Connection, *arguments: Any) -> None:
        original(self, *arguments)
        if rest := left.pop(self.channel, b""):
            self._decoder.receive(rest)

    def receive(original: Any, self: Connection, data: bytes, now: float) -> None:
        if not data:
            left[self.channel] = bytes(self._decoder._unfinished)
        original(self, data, now)

    wrap(patch, Connection, "__init__", init)
    wrap(patch, Connection, "receive", receive)


@mutant("FRM-6", check="check_cut_request_is_not_answered", reason="replies to 0 whole requests")
def server_makes_do_with_a_cut_packet(patch: Patch) -> None:
    """Takes what has come of a packet for the whole when the stream ends."""

    def receive(original: Any, self: Connection, data: bytes, now: float) -> None:
        if not data and self._decoder.incomplete:
            original(self, b" ", now)
        original(self, data, now)

    wrap(patch, Connection, "receive", receive)


@mutant("FRM-7", reason="the header arrived alone")
def server_writes_header_and_payload_apart(patch: Patch) -> None:
    """Sends the header of what it sends, and two milliseconds later the rest."""

    def flush(original: Any, self: Service, peer: Peer, now: float) -> None:
        unsent = peer.connection.unsent
        if len(unsent) > 4:
            del unsent[: peer.socket.send(unsent[:4])]
            time.sleep(0.002)
        original(self, peer, now)

    wrap(patch, Service, "_flush", flush)


def _forget_what_is_left_over(patch: Patch, channel: str) -> None:
    def receive(original: Any, self: Connection, data: bytes, now: float) -> Any:
        given = original(self, data, now)
        if self.channel == channel:
            self._decoder._unfinished.clear()
        return given

    wrap(patch, Connection, "receive", receive)
