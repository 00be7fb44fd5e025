"""Packets out of one connection, and the time that a packet may take [FRM-4, FRM-5, FRM-6]."""

from collections.abc import Iterator

from splatbus_schemas import LIMITS
from splatbus_wire.framing import PacketDecoder

COMPLETION_SECONDS: float = LIMITS["packet_completion_seconds"]


class Incoming:
    """The receiving half of one connection.

    A new connection takes a new one, so half a packet never continues on another [FRM-6].
    """

    def __init__(self) -> None:
        self._decoder = PacketDecoder()
        self.deadline: float | None = None
        """When the packet that has begun has to be complete, in seconds of the caller's clock."""

    def receive(self, data: bytes, now: float) -> Iterator[bytes]:
        """Yield the payloads that `data` completes.

        Raises:
            FramingError: a header is bad; the packets before it were yielded [FRM-3].
        """
        self._decoder.receive(data)
        while (payload := self._decoder.next_packet()) is not None:
            self.deadline = None
            yield payload
        if not self._decoder.incomplete:
            self.deadline = None
        elif self.deadline is None:
            self.deadline = now + COMPLETION_SECONDS
