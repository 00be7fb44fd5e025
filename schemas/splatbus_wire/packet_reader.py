"""Packets out of one connection, and the time that each may take [FRM-4, FRM-5, FRM-6]."""

from __future__ import annotations

import math
from collections.abc import Iterator

from splatbus_schemas import LIMITS

from splatbus_wire.framing import PacketDecoder

COMPLETION_SECONDS: float = LIMITS["packet_completion_seconds"]


class PacketReader:
    """The receiving half of one connection.

    A new connection takes a new one, so half a packet never continues on another [FRM-6].

    Attributes:
        deadline: when the packet that has begun has to be complete, in seconds of the caller's
            clock [FRM-5]; infinity while none has.
        decoder: cuts what came into packets.
    """

    def __init__(self) -> None:
        self.decoder = PacketDecoder()
        self._is_held = False
        self.deadline = math.inf

    @property
    def incomplete(self) -> bool:
        """Whether the first bytes of a packet are here, and its last are not [FRM-6]."""
        return self.decoder.incomplete

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes as they came from the connection."""
        begins = not self.decoder.incomplete
        self.decoder.receive(data)
        if begins and not self._is_held:
            self.deadline = now + COMPLETION_SECONDS

    def next_packet(self, now: float) -> bytes | None:
        """Return the payload of the next packet, or None if it is not complete yet.

        Raises:
            FramingError: a header is bad; the packets before it have been handed out [FRM-3].
        """
        payload = self.decoder.next_packet()
        if payload is not None:
            self.deadline = now + COMPLETION_SECONDS
        elif not self.decoder.incomplete:
            self.deadline = math.inf
        return payload

    def packets(self, now: float) -> Iterator[bytes]:
        """Yield the payload of each packet that is complete; raises as `next_packet`."""
        while (payload := self.next_packet(now)) is not None:
            yield payload

    def hold(self) -> None:
        """Let time pass that is not the peer's, until it is told to `go_on`."""
        self._is_held = True
        self.deadline = math.inf

    def go_on(self, now: float) -> None:
        """Measure the peer's time again, from now on."""
        if self._is_held:
            self._is_held = False
            self.deadline = now + COMPLETION_SECONDS if self.incomplete else math.inf
